// Where the scene is looked at: pointer and keys move the viewer, whoever draws; over the picture stand people and the marked place.

import type { ComponentChildren, RefObject } from "preact";
import { useEffect, useState } from "preact/hooks";
import { say } from "../strings";
import { attach } from "./gestures";
import { MapInset } from "./MapInset";
import { Overlay } from "./Overlay";
import { personAt } from "./picking";
import { groundAt, placeAt } from "./scenery";
import * as state from "./state";
import { people } from "./tracking";

/** Chooses what is shown at a place: somebody, who is followed, or a place, of which is told who sees it. */
function choose(place: readonly [number, number], aspect: number): void {
  const view = state.shown.peek()?.view ?? state.looking.peek();
  if (!view) return;
  const person = state.labels.peek() === "on" ? personAt(people.peek().values(), view, aspect, place) : null;
  if (person) state.setFollowed(person.id);
  else state.setMark(placeAt(view, aspect, place));
}

export function Stage({ stage, isOld, time, children }: {
  stage: RefObject<HTMLDivElement | null>;
  isOld: boolean;
  time: number | undefined;
  children: ComponentChildren;
}) {
  const [aspect, setAspect] = useState(16 / 9);
  useEffect(() => {
    const element = stage.current;
    if (!element) return undefined;
    const sizes = new ResizeObserver(() => {
      if (element.clientHeight > 0) setAspect(element.clientWidth / element.clientHeight);
    });
    sizes.observe(element);
    const detach = attach(element, {
      mode: () => state.mode.peek(),
      move: (change) => {
        const view = state.view.peek();
        if (view) state.setView(change(view));
      },
      reset: state.resetView,
      choose: (place) => choose(place, element.clientWidth / element.clientHeight),
      groundAt,
    });
    return () => {
      sizes.disconnect();
      detach();
    };
  }, []);
  const view = state.shown.value?.view;
  return (
    <div
      ref={stage}
      class={`stage ${isOld ? "is-old" : ""}`}
      // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex -- an application takes keys
      tabIndex={0}
      role="application"
      aria-label={say(`view.label.${state.mode.value}`)}
      aria-describedby="stage-help"
      data-time={time}
      data-mode={state.mode.value}
      data-view={view ? JSON.stringify(view) : undefined}
    >
      {children}
      <Overlay aspect={aspect} />
      {state.map.value === "inset" && <MapInset />}
    </div>
  );
}
