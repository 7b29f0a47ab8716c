// Pictures from the daemon, shown without a blank moment between two.

import { Trouble } from "./ask";
import { say } from "./strings";

/** Puts the picture of a response into `image` once it is decoded, and lets go of the one before. */
export async function show(image: HTMLImageElement, response: Response): Promise<void> {
  const url = URL.createObjectURL(await response.blob());
  const before = image.src;
  // Decoded beside the page first: an image whose own source changes may be blank for a moment.
  const next = new Image();
  next.src = url;
  try {
    await next.decode();
  } catch {
    URL.revokeObjectURL(url);
    throw new Trouble(say("trouble.picture"), 200);
  }
  image.src = url;
  if (before.startsWith("blob:")) URL.revokeObjectURL(before);
}
