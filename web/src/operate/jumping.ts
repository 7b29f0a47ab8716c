// Into a camera's own picture and out of it: the view flies to where the camera stands, and back to where the viewer stood.

import { fovDeg } from "../spatial/lens";
import { flyBack, flyTo } from "./flying";
import { viewOf } from "./scenery";
import * as state from "./state";

/** Shows a camera's own picture, from the fused view by way of the camera's place. */
export async function jumpInto(camera: string): Promise<void> {
  const there = state.openedCamera.peek() === undefined ? viewOf(camera, fovDeg) : null;
  if (there) await flyTo(there);
  state.openCamera(camera);
}

/** Shows the fused view again, from where it was left. */
export function jumpOut(): void {
  state.closeCamera();
  void flyBack();
}
