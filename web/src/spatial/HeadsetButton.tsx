// The way into a scene: through a headset where there is one, else by looking around with the device in hand, or by dragging. What it
// takes is loaded when it is pressed.

import { useEffect, useRef, useState } from "preact/hooks";
import { told } from "../ask";
import type { View } from "../operate/orbit";
import { say } from "../strings";
import type { Stage } from "./stage";
import type { Surfaces } from "./surfaces";
import "./spatial.css";

type Way = "headset" | "around";

export type Props = {
  stage: Stage;
  surfaces: Surfaces;
  view: () => View | null;
  onView: (view: View) => void;
  /** There is neither headset nor orientation: the viewer looks around by dragging. */
  onDrag: () => void;
};

export function HeadsetButton({ stage, surfaces, view, onView, onDrag }: Props) {
  const [way, setWay] = useState<Way>("around");
  const [isIn, setIsIn] = useState(false);
  const [trouble, setTrouble] = useState<string | null>(null);
  const leave = useRef<(() => void) | null>(null);
  useEffect(() => {
    let isShown = true;
    navigator.xr?.isSessionSupported("immersive-vr").then((isThere) => {
      if (isShown && isThere) setWay("headset");
    }, () => null);
    return () => {
      isShown = false;
      leave.current?.();
    };
  }, []);

  const enter = async () => {
    const from = view();
    if (!from) return;
    setTrouble(null);
    try {
      if (way === "headset") {
        const { enterHeadset } = await import("./headset");
        const end = await enterHeadset(stage, surfaces, from, (last) => {
          leave.current = null;
          setIsIn(false);
          onView(last);
        });
        leave.current = () => void end();
      } else {
        const { lookAround } = await import("./lookAround");
        leave.current = await lookAround(() => view() ?? from, onView);
        if (!leave.current) {
          onDrag();
          return;
        }
      }
      setIsIn(true);
    } catch (error) {
      setTrouble(say("spatial.headset.failed", { message: told(error) }));
    }
  };
  const press = () => {
    if (!isIn) {
      void enter();
      return;
    }
    leave.current?.();
    leave.current = null;
    setIsIn(false);
  };
  const name = isIn ? "spatial.headset.leave" : way === "headset" ? "spatial.headset.enter" : "spatial.headset.around";
  return (
    <div class="headset" data-own="">
      <button type="button" aria-pressed={isIn} onClick={press} title={say(`${name}.title`)}>{say(name)}</button>
      {trouble !== null && <p role="alert">{trouble}</p>}
    </div>
  );
}
