// A live example: the view on Operate as the chosen setting draws it, beside the same view and time drawn exactly.

import { useEffect, useRef, useState } from "preact/hooks";
import { ask, told } from "../../ask";
import { pauser } from "../../pause";
import { say } from "../../strings";
import { drawnIn, stages } from "../timing";
import { rmse } from "./curves";
import { EXACT, type Looked, type Parameters, SIZE } from "./settings";

const AGAIN_MILLIS = 3_000;
/** Both show a moment that all cameras have surely reached. */
const BACK_MILLIS = 500;

type Drawn = { readonly url: string; readonly pixels: Uint8ClampedArray; readonly millis: number; readonly isKept: boolean };

async function pixelsOf(blob: Blob): Promise<Uint8ClampedArray> {
  const bitmap = await createImageBitmap(blob);
  const canvas = document.createElement("canvas");
  [canvas.width, canvas.height] = [bitmap.width, bitmap.height];
  const context = canvas.getContext("2d", { willReadFrequently: true });
  context?.drawImage(bitmap, 0, 0);
  bitmap.close();
  return context?.getImageData(0, 0, canvas.width, canvas.height).data ?? new Uint8ClampedArray();
}

async function draw({ scene, view }: Looked, parameters: Parameters, t: string, signal: AbortSignal): Promise<Drawn & { time: string }> {
  const response = await ask(`/api/v1/scenes/${encodeURIComponent(scene)}/view.jpg`, { ...view, ...parameters, ...SIZE, t }, { signal });
  const field = (name: string) => response.headers.get(name) ?? "";
  const told = stages(field("server-timing"));
  const blob = await response.blob();
  return {
    url: URL.createObjectURL(blob), pixels: await pixelsOf(blob), millis: drawnIn(told), isKept: field("videofields-cache") === "hit", time: field("videofields-time"),
  };
}

function Picture({ title, drawn, children }: { title: string; drawn: Drawn | undefined; children?: string }) {
  return (
    <figure>
      <figcaption>
        <strong>{title}</strong>{" "}
        <span class="quiet">{drawn && (drawn.isKept ? say("system.example.kept") : say("system.example.took", { ms: drawn.millis.toFixed(0) }))} {children}</span>
      </figcaption>
      {drawn ? <img src={drawn.url} alt={title} width={SIZE.width} height={SIZE.height} /> : <div class="no-picture">{say("system.example.coming")}</div>}
    </figure>
  );
}

export function Example({ looked, parameters, title }: { looked: Looked; parameters: Parameters; title: string }) {
  const [pair, setPair] = useState<{ chosen: Drawn; exact: Drawn } | null>(null);
  const [trouble, setTrouble] = useState("");
  const urls = useRef<string[]>([]);
  const key = JSON.stringify([looked, parameters]);
  useEffect(() => () => urls.current.forEach((url) => URL.revokeObjectURL(url)), []);
  useEffect(() => {
    const [gone, { pause, wake }] = [new AbortController(), pauser()];
    const isGone = () => gone.signal.aborted;
    const round = async () => {
      const t = looked.view["t"] ?? new Date(Date.now() - BACK_MILLIS).toISOString();
      const chosen = await draw(looked, parameters, t, gone.signal);
      const exact = await draw(looked, EXACT, t, gone.signal);
      if (isGone()) return;
      setPair({ chosen, exact });
      setTrouble("");
      const before = urls.current;
      urls.current = [chosen.url, exact.url];
      setTimeout(() => before.forEach((url) => URL.revokeObjectURL(url)), 1_000);
    };
    const run = async () => {
      // Not while the slider still moves.
      await pause(300);
      while (!isGone()) {
        try {
          if (!document.hidden) await round();
        } catch (error) {
          if (!isGone()) setTrouble(told(error));
        }
        await pause(AGAIN_MILLIS);
      }
    };
    void run();
    return () => {
      gone.abort();
      wake();
    };
  }, [key]);
  return (
    <>
      <div class="example">
        <Picture title={title} drawn={pair?.chosen}>{pair ? say("system.example.apart", { error: rmse(pair.chosen.pixels, pair.exact.pixels).toFixed(1) }) : ""}</Picture>
        <Picture title={say("system.setting.exact")} drawn={pair?.exact} />
      </div>
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
    </>
  );
}
