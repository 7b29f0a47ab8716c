// A picture of the ground where it lies on the map, as its control points or bounds have it.

import { useEffect, useState } from "preact/hooks";
import { mapOf } from "../../spatial/planeMap";
import { urlOf } from "../assets";
import type { Frame } from "../plan/frame";
import type { Origin } from "./earth";
import { type Imagery, worldFromPixel } from "./placement";
import { sizes } from "./tools";

/** An address of a file that the page may show; null where there is none (yet). */
export function useUrl(file: string | undefined): { url: string | null; isMissing: boolean } {
  const [shown, setShown] = useState<{ file: string; url: string | null } | null>(null);
  useEffect(() => {
    if (file === undefined) return undefined;
    let isWanted = true;
    const come = (url: string | null) => {
      if (isWanted) setShown({ file, url });
    };
    urlOf(file).then(come, () => come(null));
    return () => {
      isWanted = false;
    };
  }, [file]);
  const isOf = shown !== null && shown.file === file;
  return { url: isOf ? shown.url : null, isMissing: isOf && shown.url === null };
}

/** The screen's transform of a picture: from its pixels to the map's. */
function transform(frame: Frame, rows: readonly (readonly number[])[]): string {
  const { center, scale, size_px } = frame;
  const [u = [], v = [], q = []] = rows;
  const mixed = (own: readonly number[], factor: number, shift: number) => own.map((part, i) => factor * part + shift * (q[i] ?? 0));
  const x = mixed(u, scale, size_px[0] / 2 - center[0] * scale);
  const y = mixed(v, -scale, size_px[1] / 2 + center[1] * scale);
  const column = (i: number) => [x[i], y[i], 0, q[i]];
  return `matrix3d(${[...column(0), ...column(1), 0, 0, 1, 0, ...column(2)].join(",")})`;
}

export function GroundPicture({ imagery, origin, frame }: { imagery: Imagery; origin: Origin | undefined; frame: Frame }) {
  const { file } = imagery;
  const { url } = useUrl(file);
  const size = sizes.value[file];
  const map = size ? mapOf(imagery, size, origin) : null;
  const rows = map && size ? worldFromPixel(map, size) : null;
  if (url === null) return null;
  return (
    <img class="ground-picture" src={url} alt="" draggable={false}
      onLoad={({ currentTarget: { naturalWidth, naturalHeight } }) => {
        if (!sizes.value[file]) sizes.value = { ...sizes.value, [file]: [naturalWidth, naturalHeight] };
      }}
      style={rows && size ? { width: `${size[0]}px`, height: `${size[1]}px`, transform: transform(frame, rows) } : { visibility: "hidden" }} />
  );
}
