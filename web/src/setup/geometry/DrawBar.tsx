// What to do next with the tool in hand; heights are typed here.

import { useLayoutEffect, useRef } from "preact/hooks";
import { say } from "../../strings";
import { NumberField } from "../Fields";
import { enter, finish, put, setHeight, setThickness, stepBack, usual } from "./drawings";
import { drawing, tool } from "./state";

const EXTENT_M = [0.001, 100_000] as const;

/** Enter in a field goes on, Escape goes back. */
function onKey(event: KeyboardEvent): void {
  if (event.key === "Enter" && !(event.target instanceof HTMLButtonElement)) enter();
  else if (event.key === "Escape") stepBack();
  else return;
  event.preventDefault();
  event.stopPropagation();
}

function Height({ height }: { height: number }) {
  const box = useRef<HTMLDivElement>(null);
  // Whoever drew the outline types its height at once, and Escape gives the keys back to where it was drawn.
  useLayoutEffect(() => {
    const before = document.activeElement;
    const field = box.current?.querySelector("input");
    field?.focus({ preventScroll: true });
    field?.select();
    return () => {
      if (before instanceof HTMLElement && before.isConnected) before.focus({ preventScroll: true });
    };
  }, []);
  return (
    <div ref={box}>
      <NumberField label={say("geometry.height")} unit="m" min={EXTENT_M[0]} max={EXTENT_M[1]} value={height}
        onChange={(value) => value !== null && setHeight(value)} />
    </div>
  );
}

export function DrawBar() {
  const of = drawing.value;
  if (tool.value === "select") return null;
  const isWall = (of?.tool ?? tool.value) === "wall";
  return (
    // eslint-disable-next-line jsx-a11y/no-static-element-interactions -- keys of the fields within
    <div class="geo-drawbar" onKeyDown={onKey}>
      <p role="status">{of?.stage === "height" ? say("geometry.draw.height") : say(`geometry.draw.${of?.tool ?? tool.value}`)}</p>
      {isWall && (
        <NumberField label={say("geometry.thickness")} unit="m" min={0.01} max={100} value={of?.thickness ?? usual.value.thickness}
          onChange={(value) => value !== null && setThickness(value)} />
      )}
      {of?.stage === "height" && <Height height={of.height} />}
      {of?.stage === "height" && <button type="button" class="is-main" onClick={finish}>{say("geometry.draw.done")}</button>}
      {of?.stage === "outline" && (of.tool === "wall" || of.tool === "footprint") && (
        <button type="button" onClick={enter}>{say("geometry.draw.close")}</button>
      )}
      <button type="button" onClick={() => (of ? stepBack(true) : put("select"))}>{say("geometry.draw.cancel")}</button>
    </div>
  );
}
