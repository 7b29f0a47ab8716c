// A place of the page in which a scene is drawn by the browser. What callers add stands in the world's axes; who adds gizmos gets the
// stage itself. Gizmos listen on `stage.host` (which captures the pointer), and set `stage.isHeld` while they are dragged:
//
//   const gizmo = new TransformControls(stage.camera, stage.host);
//   gizmo.addEventListener("dragging-changed", ({ value }) => (stage.isHeld = value === true));
//   gizmo.addEventListener("change", stage.redraw);
//   stage.scene.add(gizmo.getHelper());

import type { ComponentChildren } from "preact";
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import type { Object3D } from "three";
import type { View } from "../operate/orbit";
import { say } from "../strings";
import { type Mode, clicks, control } from "./controls";
import { type Health, Stage } from "./stage";
import type { Picked, Surfaces } from "./surfaces";
import "./spatial.css";

export type { Mode } from "./controls";
export type { Stage } from "./stage";

export type Props = {
  /** What is read to who cannot see it. */
  label: string;
  /** Id of the text that says how to move. */
  describedBy?: string;
  surfaces: Surfaces | null;
  view: View;
  /** Where the viewer moved to; the caller keeps it and gives it back as `view`. */
  onView?: (view: View) => void;
  /** Back to where the scene is best seen from (key 0). */
  onReset?: () => void;
  mode?: Mode;
  /** In world axes, relative to the surfaces' anchor. */
  objects?: readonly Object3D[];
  /** A place was clicked: null where nothing stands. */
  onPick?: (picked: Picked | null, event: PointerEvent) => void;
  /** Once, when there is something to draw with. Answers what undoes what it did. */
  onStage?: (stage: Stage) => (() => void) | undefined;
  /** Shown over the picture. */
  children?: ComponentChildren;
  class?: string;
};

const NOTHING: readonly Object3D[] = [];

export function Viewport(given: Props) {
  const host = useRef<HTMLDivElement>(null);
  const latest = useRef(given);
  latest.current = given;
  const [stage, setStage] = useState<Stage | null>(null);
  const [health, setHealth] = useState<Health>("fine");

  useEffect(() => {
    if (!host.current) return undefined;
    let made: Stage;
    try {
      made = new Stage(host.current, setHealth);
    } catch {
      setHealth("none");
      return undefined;
    }
    setStage(made);
    const undo = latest.current.onStage?.(made);
    const sizes = new ResizeObserver(made.resize);
    sizes.observe(host.current);
    const stopClicks = clicks(host.current, (event) => {
      if (made.isHeld) return;
      latest.current.onPick?.(latest.current.surfaces?.pick(made.rayAt(event.clientX, event.clientY)) ?? null, event);
    });
    return () => {
      stopClicks();
      sizes.disconnect();
      undo?.();
      made.dispose();
    };
  }, []);

  useLayoutEffect(() => stage?.look(given.view), [stage, given.view]);
  useLayoutEffect(() => stage?.show(given.surfaces), [stage, given.surfaces]);
  const objects = given.objects ?? NOTHING;
  useLayoutEffect(() => {
    if (!stage || objects.length === 0) return undefined;
    stage.world.add(...objects);
    stage.redraw();
    return () => {
      stage.world.remove(...objects);
      stage.redraw();
    };
  }, [stage, objects]);

  const mode = given.mode ?? "orbit";
  useEffect(() => {
    if (!stage) return undefined;
    return control(stage, {
      mode,
      move: (change) => {
        const { view, onView } = latest.current;
        if (!onView) return;
        // Keys that are held move on from where the last one led, whether or not the caller has drawn since.
        const next = change(view);
        latest.current = { ...latest.current, view: next };
        stage.look(next);
        onView(next);
      },
      reset: () => latest.current.onReset?.(),
      surfaces: () => latest.current.surfaces,
    });
  }, [stage, mode]);

  return (
    <div
      ref={host}
      class={`viewport ${given.class ?? ""}`}
      // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex -- an application takes keys
      tabIndex={0}
      role="application"
      aria-label={given.label}
      aria-describedby={given.describedBy}
    >
      {given.children}
      {health !== "fine" && <p class="viewport-health" role="alert">{say(health === "none" ? "spatial.none" : "spatial.lost")}</p>}
    </div>
  );
}
