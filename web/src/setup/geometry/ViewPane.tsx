// What stands there as the browser draws it, with the cameras' pictures on it, to draw and drag in.

import { useMemo, useRef, useState } from "preact/hooks";
import type { View } from "../../operate/orbit";
import { say } from "../../strings";
import { type Stage, Viewport } from "../../spatial/Viewport";
import type { Corner } from "../plan/frame";
import { attachPress } from "../plan/press";
import { type Eye, viewEye } from "./eye";
import { onKey } from "./keys";
import { useLive } from "./live";
import { Overlay } from "./Overlay";
import { pointing } from "./pointing";
import { cursor, shown, view } from "./state";
import { useSurfaces } from "./surfacesShown";
import { extentOf, things } from "./things";

const FOV_DEG = 45;

/** A picture that is at least so much wider than high shows as much beside as above. */
const WIDE = 1.25;

/** Where everything is seen from, from the south and above, in a picture of this shape. */
export function wholeView(aspect: number): View {
  const { ground = [], view: own } = shown.value;
  const places = [...ground.flatMap(({ polygon }) => polygon), ...things(shown.value).flatMap((one) => extentOf(one).outline)];
  if (places.length === 0) {
    if (own) return { eye: [own.eye_m[0] ?? 0, own.eye_m[1] ?? -20, own.eye_m[2] ?? 10], target: [own.target_m[0] ?? 0, own.target_m[1] ?? 0, own.target_m[2] ?? 0], fov: own.fov_deg ?? FOV_DEG };
    return { eye: [0, -25, 18], target: [0, 0, 0], fov: FOV_DEG };
  }
  const [xs, ys] = [places.map(([x = 0]) => x), places.map(([, y = 0]) => y)];
  const [west, east, south, north] = [Math.min(...xs), Math.max(...xs), Math.min(...ys), Math.max(...ys)];
  const across = Math.max(east - west, north - south, 5) * Math.max(1, WIDE / aspect);
  const [x, y] = [(west + east) / 2, (south + north) / 2];
  return { eye: [x, y - across * 0.95, across * 0.65], target: [x, y, 0], fov: FOV_DEG };
}

export function ViewPane() {
  const [stage, setStage] = useState<Stage | null>(null);
  const [size, setSize] = useState<Corner>([0, 0]);
  const surfaces = useSurfaces(stage);
  useLive(stage, surfaces);
  // What is drawn meanwhile moves no view.
  const aspect = size[0] / Math.max(size[1], 1) || WIDE;
  const whole = useMemo(() => wholeView(aspect), [view.value === null, aspect]);
  const at = view.value ?? whole;
  const sight = useRef<Eye>(viewEye(at, size));
  sight.current = viewEye(at, size);
  const onStage = (made: Stage) => {
    setStage(made);
    const measure = () => setSize([made.host.clientWidth, made.host.clientHeight]);
    const sizes = new ResizeObserver(measure);
    sizes.observe(made.host);
    measure();
    const handlers = pointing(() => sight.current);
    // Before the view's own gestures hear of it: what is grasped or drawn turns no view.
    const hold = (isHeld: boolean) => {
      made.isHeld = isHeld;
    };
    const detach = attachPress(made.host, () => ({
      ...handlers,
      press: (place, event) => {
        const drag = handlers.press(place, event);
        hold(drag !== null);
        return drag && {
          ...drag,
          end: (to, ended, isClick) => {
            hold(false);
            drag.end(to, ended, isClick);
          },
          cancel: () => {
            hold(false);
            drag.cancel();
          },
        };
      },
      // The view moves itself.
      travel: () => {},
      zoom: () => {},
    }));
    return () => {
      detach();
      sizes.disconnect();
    };
  };
  return (
    <div class="geo-view" style={{ cursor: cursor.value }} onKeyDownCapture={onKey}>
      <Viewport label={say("geometry.view")} describedBy="geometry-keys" surfaces={surfaces} view={at} onStage={onStage}
        onView={(next) => {
          view.value = next;
        }}
        onReset={() => {
          view.value = null;
        }}>
        {size[0] > 0 && (
          <svg class="geo-overlay" width={size[0]} height={size[1]} aria-hidden="true"><Overlay eye={sight.current} /></svg>
        )}
      </Viewport>
    </div>
  );
}
