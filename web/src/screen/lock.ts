// Screens of one browser change at once: each holds a frame until the others have it too. Screens of other machines go by the clock
// alone (`delay`). Who keeps the others waiting is waited for once, and again when it has caught up.

/** A screen that was not heard for so long has gone. */
const GONE_MILLIS = 3_000;

/** Another screen of this wall: the frame that it holds, the one that it shows, and when it was heard. */
type Peer = { holds: number | null; shows: number | null; version: string; at: number; isSlow: boolean };

export type Lock = {
  /** Another screen has a frame in hand. */
  holds: (page: string, version: string, frame: number) => void;
  /** Another screen is there, and shows that. */
  shows: (page: string, frame: number | null) => void;
  gone: (page: string) => void;
  /** Resolves once all others have the frame, or one of the same version after it, or when `patience` is over. */
  together: (version: string, frame: number, patience: number) => Promise<void>;
  /** Frames that the others show. */
  peers: () => readonly { readonly frame: number | null }[];
};

export function makeLock(now: () => number = () => performance.now()): Lock {
  const peers = new Map<string, Peer>();
  let look = () => {};
  const peer = (page: string): Peer => {
    const found = peers.get(page) ?? { holds: null, shows: null, version: "", at: 0, isSlow: false };
    found.at = now();
    peers.set(page, found);
    return found;
  };
  const sweep = () => {
    for (const [page, { at }] of peers) if (now() - at > GONE_MILLIS) peers.delete(page);
  };
  const awaited = (version: string, frame: number) =>
    [...peers.values()].filter((of) => !of.isSlow && of.version === version && of.holds !== null && of.holds < frame);
  return {
    holds: (page, version, frame) => {
      Object.assign(peer(page), { holds: frame, version, isSlow: false });
      look();
    },
    shows: (page, frame) => {
      peer(page).shows = frame;
    },
    gone: (page) => {
      peers.delete(page);
      look();
    },
    together: (version, frame, patience) => {
      sweep();
      if (awaited(version, frame).length === 0) return Promise.resolve();
      return new Promise((resolve) => {
        const before = look;
        const end = () => {
          clearTimeout(timer);
          look = before;
          resolve();
        };
        const timer = setTimeout(() => {
          for (const slow of awaited(version, frame)) slow.isSlow = true;
          end();
        }, patience);
        look = () => {
          before();
          if (awaited(version, frame).length === 0) end();
        };
      });
    },
    peers: () => {
      sweep();
      return [...peers.values()].map(({ shows }) => ({ frame: shows }));
    },
  };
}
