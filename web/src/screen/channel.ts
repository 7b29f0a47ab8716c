// What the pages of one browser tell each other about a wall's screens: every screen how it fares, the place Wall which pattern they
// are to show. Pages of other machines do not hear it; there the keys of a screen's page do the same.

export type Pattern = "none" | "test" | "identify";

/** How a screen fares, as it says itself. */
export type Health = {
  readonly wall: string;
  readonly tile: string;
  /** The page, since two may show one tile. */
  readonly page: string;
  /** Number of the frame that is shown; null before the first. */
  readonly frame: number | null;
  readonly ageMillis: number | null;
  readonly rate: number;
  readonly wantedRate: number;
  readonly late: number;
  readonly missed: number;
  readonly unreadable: number;
  readonly reconnects: number;
  readonly offsetMillis: number | null;
  readonly way: "socket" | "pull" | "none";
  readonly pattern: Pattern;
  readonly trouble: string;
};

export type Message =
  | { readonly kind: "health"; readonly health: Health }
  | { readonly kind: "holds"; readonly wall: string; readonly page: string; readonly version: string; readonly frame: number }
  | { readonly kind: "pattern"; readonly wall: string; readonly pattern: Pattern }
  | { readonly kind: "gone"; readonly page: string };

const NAME = "videofields.screens";

/** Opens the channel; what comes in goes to `hear`. */
export function openChannel(hear: (message: Message) => void): { tell: (message: Message) => void; close: () => void } {
  if (typeof BroadcastChannel === "undefined") return { tell: () => {}, close: () => {} };
  const channel = new BroadcastChannel(NAME);
  channel.addEventListener("message", ({ data }: MessageEvent<Message>) => hear(data));
  return { tell: (message) => channel.postMessage(message), close: () => channel.close() };
}
