// Tools, and how the stage is shown.

import { Segments } from "../../parts/parts";
import { say } from "../../strings";
import { isReadOnly } from "../draft";
import { put } from "./drawings";
import { ModelButton } from "./ModelButton";
import { GRIDS, LAYOUTS, LIVES, OPACITIES, TOOLS, type Tool, gridName, layout, liveName, opacityName, setNamed, showAll, tool } from "./state";

const KEYS: Record<Tool, string> = { select: "V", box: "B", cylinder: "C", wall: "W", footprint: "F" };
const ICONS: Record<Tool, string> = {
  select: "M5 3l12 10-6 1-3 6z",
  box: "M4 8l8-4 8 4v8l-8 4-8-4zM4 8l8 4 8-4M12 12v8",
  cylinder: "M5 6c0-3 14-3 14 0s-14 3-14 0v12c0 3 14 3 14 0V6",
  wall: "M3 18l7-5 11 3v-6l-11-3-7 5zM10 7v6",
  footprint: "M4 4h9v6h7v10H4z",
};

function ToolButton({ of }: { of: Tool }) {
  const text = say(`geometry.tool.${of}`);
  return (
    <button type="button" class={tool.value === of ? "is-on" : undefined} aria-pressed={tool.value === of} aria-keyshortcuts={KEYS[of]}
      title={say("geometry.tool.title", { tool: text, key: KEYS[of] })} disabled={of !== "select" && isReadOnly.value} onClick={() => put(of)}>
      <svg viewBox="0 0 24 24" width="20" height="20" aria-hidden="true"><path d={ICONS[of]} /></svg>
      <span>{text}</span>
    </button>
  );
}

export function ToolBar() {
  return (
    <div class="geo-bar">
      <div class="geo-tools" role="toolbar" aria-label={say("geometry.tools")}>
        {TOOLS.map((of) => <ToolButton key={of} of={of} />)}
        <ModelButton />
      </div>
      <Segments name="geo-layout" label={say("geometry.layout")} values={LAYOUTS} chosen={layout.value}
        text={(value) => say(`geometry.layout.${value}`)} onChoose={(value) => setNamed("layout", value)} />
      <details class="menu">
        <summary>{say("geometry.show")}</summary>
        <div class="menu-box geo-show">
          <span>{say("geometry.live")}</span>
          <Segments name="geo-live" label={say("geometry.live")} values={LIVES} chosen={liveName.value}
            text={(value) => say(`geometry.live.${value}`)} onChoose={(value) => setNamed("live", value)} />
          <span>{say("geometry.opacity")}</span>
          <Segments name="geo-opacity" label={say("geometry.opacity")} values={OPACITIES} chosen={opacityName.value}
            text={(value) => `${Math.round(Number(value) * 100)} %`} onChoose={(value) => setNamed("opacity", value)} />
          <span>{say("geometry.grid")}</span>
          <Segments name="geo-grid" label={say("geometry.grid")} values={GRIDS} chosen={gridName.value}
            text={(value) => (value === "0" ? say("geometry.grid.none") : say("plan.metres", { n: value }))} onChoose={(value) => setNamed("grid", value)} />
        </div>
      </details>
      <button type="button" onClick={showAll}>{say("geometry.all")}</button>
    </div>
  );
}
