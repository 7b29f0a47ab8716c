// The surfaces of the document as it is shown: hidden, seen through and lit as the stage has it.

import { useEffect, useLayoutEffect, useMemo, useRef } from "preact/hooks";
import { type Surfaces, surfacesOf } from "../../spatial/surfaces";
import type { Stage } from "../../spatial/stage";
import { readExtents } from "./modelExtents";
import { chosen, hidden, opacityName, shown } from "./state";
import { pointerOf, things } from "./things";

const GLOW = ["#ffb020", 0.25] as const;

/** `isPlain`: nothing is lit, since who shows it draws lines over what is chosen. */
export function useSurfaces(stage: Stage | null, isPlain = false): Surfaces {
  const drawn = useRef(stage);
  drawn.current = stage;
  const surfaces = useMemo(() => {
    // It tells of changes while it is being made, too.
    let made: Surfaces | null = null;
    const onChange = () => {
      drawn.current?.redraw();
      if (made) readExtents(made);
    };
    made = surfacesOf(shown.value, { onChange });
    return made;
  }, []);
  useEffect(() => () => surfaces.dispose(), [surfaces]);
  const [document, opacity, lit, unseen] = [shown.value, Number(opacityName.value), isPlain ? [] : chosen.value, hidden.value];
  useLayoutEffect(() => surfaces.update(document), [surfaces, document]);
  useLayoutEffect(() => {
    for (const { of: { id } } of things(document)) {
      const key = pointerOf(document, id);
      if (key !== null) surfaces.style(key, { opacity, isHidden: unseen.has(id), glow: lit.includes(id) ? GLOW : null });
    }
  }, [surfaces, document, opacity, lit.join(), unseen]);
  return surfaces;
}
