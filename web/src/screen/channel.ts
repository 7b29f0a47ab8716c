// What the screens of one browser tell each other, so that they change at once: the frame that each has in hand, and shows.

export type Message =
  | { readonly kind: "shows"; readonly wall: string; readonly page: string; readonly frame: number | null }
  | { readonly kind: "holds"; readonly wall: string; readonly page: string; readonly version: string; readonly frame: number }
  | { readonly kind: "gone"; readonly page: string };

const NAME = "videofields.screens";

/** Opens the channel; what comes in goes to `hear`. */
export function openChannel(hear: (message: Message) => void): { tell: (message: Message) => void; close: () => void } {
  if (typeof BroadcastChannel === "undefined") return { tell: () => {}, close: () => {} };
  const channel = new BroadcastChannel(NAME);
  channel.addEventListener("message", ({ data }: MessageEvent<Message>) => hear(data));
  return { tell: (message) => channel.postMessage(message), close: () => channel.close() };
}
