// A camera's own picture, asked for anew whenever the camera has another frame; one request at a time.

import { useEffect, useRef, useState } from "preact/hooks";
import { ask } from "../ask";
import { pauser, seen } from "../pause";
import { show } from "../picture";
import { say } from "../strings";
import { instant, millisOf } from "./moments";
import type { Camera, Kind } from "./state";

const AFTER_TROUBLE_MILLIS = 2_000;

/** Follows one camera; `everyMillis` apart, live or (`at`) at a time. */
export function CameraPicture({ camera, kind, at, everyMillis, onShown }: {
  camera: Camera;
  kind: Kind;
  at: number | null;
  everyMillis: number;
  /** Hears of every picture's own time. */
  onShown?: (millis: number) => void;
}) {
  const image = useRef<HTMLImageElement>(null);
  const latest = useRef(camera);
  latest.current = camera;
  const wake = useRef(() => {});
  const [isShown, setShown] = useState(false);
  const [failure, setFailure] = useState(false);
  const wish = useRef({ kind, at });
  wish.current = { kind, at };
  const tell = useRef(onShown);
  tell.current = onShown;
  useEffect(() => {
    const ending = new AbortController();
    const rest = pauser();
    wake.current = rest.wake;
    let tag: string | null = null;
    let shown = "";
    const isOver = () => ending.signal.aborted;
    const run = async () => {
      while (!isOver()) {
        await seen();
        const start = performance.now();
        let pause = everyMillis;
        const { kind, at } = wish.current;
        const { id, frames, size_px } = latest.current;
        const wanted = `${kind} ${at ?? `live ${frames}`}`;
        try {
          // Cards hear of frames by the list of cameras; a camera alone asks as fast as it may.
          if (size_px && image.current && (wanted !== shown || (at === null && everyMillis < 500))) {
            const path = `/api/v1/cameras/${encodeURIComponent(id)}/${kind}.${kind === "mask" ? "png" : "jpg"}`;
            const t = at === null ? null : instant(at);
            const response = await ask(path, { t }, { signal: ending.signal, tag });
            if (response.status !== 304) {
              await show(image.current, response);
              if (isOver()) return;
              tell.current?.(millisOf(response.headers.get("Videofields-Time")));
              tag = response.headers.get("ETag");
            }
            shown = wanted;
            setShown(true);
            setFailure(false);
          }
        } catch {
          if (isOver()) return;
          // The camera's state says why; only that this is no picture of now is said here.
          setFailure(true);
          pause = AFTER_TROUBLE_MILLIS;
        }
        await rest.pause(Math.max(30, pause - (performance.now() - start)));
      }
    };
    void run();
    const shownImage = image.current;
    return () => {
      ending.abort();
      rest.wake();
      if (shownImage?.src.startsWith("blob:")) URL.revokeObjectURL(shownImage.src);
    };
  }, [camera.id, everyMillis]);
  useEffect(() => wake.current(), [kind, at]);
  const [width = 16, height = 9] = camera.size_px ?? [];
  return (
    <>
      <img ref={image} class={isShown ? "" : "is-empty"} style={{ aspectRatio: `${width} / ${height}` }}
        alt={isShown ? say("camera.alt", { kind: say(`kind.${kind}`), name: camera.name }) : ""} draggable={false} />
      {failure && <span class="veil at-top">{say("camera.noPicture")}</span>}
    </>
  );
}
