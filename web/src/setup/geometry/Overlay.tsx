// What is drawn over map and view alike, in pixels: outlines of what is chosen, what can be grasped, what is being drawn, guides, and
// where the cameras are.

import type { Point } from "../../operate/orbit";
import { say } from "../../strings";
import type { Corner } from "../plan/frame";
import { draft } from "../draft";
import { CameraMarks } from "./CameraMarks";
import { type Eye } from "./eye";
import type { Handle } from "./handles";
import { enlarged } from "./near";
import { extentOfAll } from "./operations";
import { type Outline, middle } from "./outline";
import { handlesNow } from "./pointing";
import { chosen, drawing, fileExtents, guides, shown, tool } from "./state";
import { type Extent, extentOf, things } from "./things";
import { type Drawing, outlineOf } from "./tools/drawing";
import { sizes } from "./tools/sizes";

/** Beyond so many corners an outline has no upright lines. */
const MOST_UPRIGHTS = 24;

function path(pieces: readonly (readonly Corner[])[]): string {
  return pieces.map((piece) => `M${piece.map((at) => at.map((px) => px.toFixed(1)).join(" ")).join("L")}`).join("");
}

const raised = (outline: Outline, height: number): Point[] => outline.map((at) => [...at, height]);

/** The lines of a prism. */
export function prismPath(eye: Eye, { outline, low, high }: Omit<Extent, "middle">): string {
  if (eye.isLevel) return path(eye.lines(raised(outline, high), true));
  const uprights = outline.length > MOST_UPRIGHTS ? [] : outline.flatMap((at) => eye.lines([[...at, low], [...at, high]], false));
  return path([...eye.lines(raised(outline, low), true), ...eye.lines(raised(outline, high), true), ...uprights]);
}

function Chosen({ eye }: { eye: Eye }) {
  const of = chosen.value;
  const files = fileExtents.value;
  const all = of.length > 1 ? extentOfAll(shown.value, of, files) : null;
  return (
    <g class="geo-chosen">
      {things(shown.value).filter(({ of: { id } }) => of.includes(id)).map((one) => (
        <path key={one.of.id} d={prismPath(eye, extentOf(one, files))} />
      ))}
      {all && <path class="is-all" d={prismPath(eye, all)} />}
    </g>
  );
}

/** What a handle looks like, around where it is. */
function Shape({ kind }: { kind: Handle["kind"] }) {
  switch (kind) {
    case "corner":
    case "vertex":
    case "side":
      return <rect x={-5} y={-5} width={10} height={10} />;
    case "top":
      return <path d="M-7 3L0-7L7 3Z" />;
    case "lift":
      return <path d="M0-9L6 0L0 9L-6 0Z" />;
    case "between":
      return <circle r={3.5} />;
    case "turn":
      return <circle r={7} />;
  }
}

function Handles({ eye }: { eye: Eye }) {
  const extent = extentOfAll(shown.value, chosen.value, fileExtents.value);
  const from = extent && eye.place([...extent.middle, extent.high]);
  const scale = enlarged();
  return (
    <g class="geo-handles">
      {handlesNow(eye).map(({ key, kind, at }) => {
        const place = eye.place(at);
        if (!place) return null;
        const isArm = from && (kind === "turn" || kind === "lift");
        return (
          <g key={key} class={`is-${kind}`}>
            {isArm && <line x1={from[0]} y1={from[1]} x2={place[0]} y2={place[1]} />}
            <g transform={`translate(${place[0]} ${place[1]}) scale(${scale})`}><Shape kind={kind} /></g>
          </g>
        );
      })}
    </g>
  );
}

function Guides({ eye }: { eye: Eye }) {
  const { lines, height } = guides.value;
  return (
    <g class="geo-guides">
      {lines.map(({ kind, line: [a, b] }, i) => {
        const place = eye.place([...b, height]);
        return (
          <g key={i} class={`is-${kind}`}>
            <path d={path(eye.lines([[...a, height], [...b, height]], false))} />
            {place && <circle cx={place[0]} cy={place[1]} r={kind === "corner" ? 7 : 4} />}
          </g>
        );
      })}
    </g>
  );
}

function Drawn({ eye, of }: { eye: Eye; of: Drawing }) {
  const outline = outlineOf(of);
  const isUp = of.stage === "height";
  const label = eye.place(isUp ? [...middle(outline), of.base + of.height] : [...of.pointer, of.base]);
  return (
    <g class={`geo-drawn ${of.fault === "crossing" ? "is-wrong" : ""}`}>
      {isUp
        ? <path d={prismPath(eye, { outline, low: of.base, high: of.base + of.height })} />
        : <path d={path(eye.lines(raised(outline, of.base), of.tool !== "footprint" || of.corners.length > 1))} />}
      {of.corners.map((at, i) => {
        const place = eye.place([...at, of.base]);
        return place && <circle key={i} cx={place[0]} cy={place[1]} r={i === 0 ? 6 : 4} />;
      })}
      {label && <text x={label[0] + 12} y={label[1] - 10}>{isUp ? say("geometry.size.height", { height: of.height.toFixed(2) }) : sizes(of)}</text>}
    </g>
  );
}

export function Overlay({ eye }: { eye: Eye }) {
  const of = drawing.value;
  const calibrations = draft.value?.scene.document.cameras ?? [];
  return (
    <>
      <CameraMarks eye={eye} cameras={calibrations} />
      <Chosen eye={eye} />
      {of && <Drawn eye={eye} of={of} />}
      <Guides eye={eye} />
      {tool.value === "select" && <Handles eye={eye} />}
    </>
  );
}
