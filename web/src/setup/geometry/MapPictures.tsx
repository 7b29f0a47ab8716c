// What cameras see of the scene from straight above, beneath the map's lines.

import { useEffect, useRef, useState } from "preact/hooks";
import { Stage } from "../../spatial/stage";
import type { Frame } from "../plan/frame";
import { useLive } from "./live";
import { useSurfaces } from "./surfacesShown";

/** So far off that roofs lie where their walls do, but for a thousandth of their height. */
const FOV_DEG = 0.1;

export function MapPictures({ frame }: { frame: Frame }) {
  const host = useRef<HTMLDivElement>(null);
  const [stage, setStage] = useState<Stage | null>(null);
  const surfaces = useSurfaces(stage, true);
  useEffect(() => {
    if (!host.current) return undefined;
    let made: Stage;
    try {
      made = new Stage(host.current, () => {});
    } catch {
      // The map does without.
      return undefined;
    }
    const sizes = new ResizeObserver(made.resize);
    sizes.observe(host.current);
    setStage(made);
    return () => {
      sizes.disconnect();
      made.dispose();
    };
  }, []);
  useEffect(() => stage?.show(surfaces), [stage, surfaces]);
  useEffect(() => {
    const [x, y] = frame.center;
    const distance = frame.size_px[1] / frame.scale / 2 / Math.tan((FOV_DEG * Math.PI) / 360);
    stage?.look({ eye: [x, y, distance], target: [x, y, 0], fov: FOV_DEG });
  }, [stage, frame]);
  useLive(stage, surfaces);
  return <div ref={host} class="geo-under" aria-hidden="true" />;
}
