// Finds the camera from its pairs: asks the daemon once there are enough of them and they rest, gives up what is outdated, and
// proposes what came, or takes it over at once where that is wanted.

import { effect, signal, untracked } from "@preact/signals";
import { Trouble, told } from "../../ask";
import { lensOf } from "../../spatial/lens";
import { type Calibrating, type Calibration, type Pair, calibrationOf, draft } from "../draft";
import { type Solved, solve } from "../requests";
import { take, taken, takeLatest } from "./edits";
import { calibrating, calibration, chosen, how, pairs, proposal, size } from "./now";
import { type Pixel, asPinhole, least } from "./pairs";
import { between, length, minus, point, quaternion } from "./torch";

const REST_MILLIS = 250;
const KEPT = "videofields.setup.takes";

export type Certainty = Pick<Solved, "position_deviation_m" | "direction_deviation_deg" | "focal_deviation_px">;
export type Answer =
  | { readonly state: "missing"; readonly n: number }
  | { readonly state: "working" }
  | { readonly state: "found"; readonly certainty: Certainty }
  | { readonly state: "refused"; readonly why: Refusal; readonly message: string };
export type Refusal = "open" | "focal" | "k1" | "none" | "lens" | "other";

/** How far the pairs have come. */
export const answer = signal<Answer>({ state: "missing", n: least({ findsFocal: true, findsK1: false }) });

/** What is to be found; a focal length is only known where there is a calibration. */
export function wanted(of: Calibrating, known: Calibration | null): Pick<Calibrating, "findsFocal" | "findsK1"> {
  return { findsFocal: known === null || of.findsFocal, findsK1: of.findsK1 };
}

/** Cameras whose found calibration is taken over at once, by choice; others as `takesOver` says. */
const choices = signal<Readonly<Record<string, boolean>>>(read());

function read(): Record<string, boolean> {
  try {
    return JSON.parse(sessionStorage.getItem(KEPT) ?? "{}") as Record<string, boolean>;
  } catch {
    return {};
  }
}

/** Whether what is found is taken over at once. Where nobody chose: only where nothing is lost by it. */
export function takesOver(camera: string): boolean {
  return choices.value[camera] ?? (draft.value !== null && calibrationOf(draft.value, camera) === null);
}

export function setTakesOver(camera: string, does: boolean): void {
  choices.value = { ...choices.value, [camera]: does };
  try {
    sessionStorage.setItem(KEPT, JSON.stringify(choices.value));
  } catch {
    // Then it holds until the page goes.
  }
}

/** Why pairs were refused, from the daemon's words. */
export function refusal(message: string): Refusal {
  if (/leave open where/.test(message)) return "open";
  if (/leave open its focal/.test(message)) return "focal";
  if (/leave open its distortion/.test(message)) return "k1";
  return /no camera shows/.test(message) ? "none" : "other";
}

type Question = { readonly camera: string; readonly pairs: readonly Pair[]; readonly size: Pixel; readonly kept: Calibration | null; readonly findsK1: boolean };

/** Only the lens of a kept calibration takes part: where the camera stands is what is looked for. */
const keyOf = ({ kept, ...rest }: Question) =>
  JSON.stringify([rest, kept && [kept.focal_px, kept.center_px, kept.distortion, kept.image_size_px]]);

function question(): Question | null {
  const [camera, of, sizePx] = [chosen.value, calibrating.value, size.value];
  if (!camera || !of || !sizePx) return null;
  const { findsFocal, findsK1 } = wanted(of, calibration.value);
  return { camera: camera.id, pairs: of.pairs, size: sizePx, kept: findsFocal ? null : calibration.value, findsK1 };
}

/** Asks, and brings what came into the form that the camera's lens has. */
async function ask({ pairs: of, size: sizePx, kept, findsK1 }: Question, ending: AbortSignal): Promise<Solved> {
  const focal = kept?.focal_px[0] ?? null;
  const known = { image_size_px: sizePx, focal_px: focal, finds_k1: findsK1 };
  if (!kept || focal === null || findsK1) return solve(known, of, ending);
  const straight = asPinhole(lensOf(kept), focal, of);
  if (!straight) throw new Trouble("lens", 422);
  const found = await solve(known, straight, ending);
  const { position_m, world_from_camera } = found.calibration;
  return { ...found, calibration: { ...kept, position_m, world_from_camera } };
}

const SAME = { metres: 1e-4, degrees: 1e-3, focal: 1e-4 } as const;

/** Whether two calibrations show the same. */
function isSame(a: Calibration, b: Calibration): boolean {
  return length(minus(point(a.position_m), point(b.position_m))) < SAME.metres
    && between(quaternion(a.world_from_camera), quaternion(b.world_from_camera)) < SAME.degrees
    && Math.abs((a.focal_px[0] ?? 0) / (b.focal_px[0] ?? 1) - 1) < SAME.focal;
}

function found(of: Question, solved: Solved, key: string | null): void {
  answer.value = { state: "found", certainty: solved };
  const before = draft.value && calibrationOf(draft.value, of.camera);
  if (before && isSame(before, solved.calibration)) return;
  const name = draft.value?.cameras.find(({ id }) => id === of.camera)?.name;
  if (key !== null && takesOver(of.camera)) {
    // Whoever lets the first be taken over wants the next ones too.
    setTakesOver(of.camera, true);
    take(of.camera, solved.calibration, taken("pairs", name ?? of.camera), key);
  } else proposal.value = { camera: of.camera, calibration: solved.calibration, from: "pairs" };
}

/** Follows the pairs while the stage is shown. Answers what ends it. */
export function follow(): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  let asked: { key: string; abort: AbortController } | null = null;
  const stop = () => {
    clearTimeout(timer);
    asked?.abort.abort();
    asked = null;
  };
  const begin = (of: Question, key: string, step: string | null) => {
    const abort = new AbortController();
    asked = { key, abort };
    timer = setTimeout(() => {
      ask(of, abort.signal).then(
        (solved) => !abort.signal.aborted && found(of, solved, step),
        (error: unknown) => {
          if (abort.signal.aborted) return;
          const message = told(error);
          answer.value = { state: "refused", why: message === "lens" ? "lens" : refusal(message), message };
        },
      );
    }, REST_MILLIS);
  };
  const end = effect(() => {
    const of = question();
    const isOn = how.value === "pairs" && of !== null;
    if (!isOn) {
      stop();
      return;
    }
    const key = keyOf(of);
    if (asked?.key === key) return;
    stop();
    untracked(() => {
      // What undoing brought back was not changed by a step of now, and takes nothing over.
      const step = takeLatest();
      if (proposal.value?.from === "pairs") proposal.value = null;
      const missing = least({ findsFocal: of.kept === null, findsK1: of.findsK1 }) - of.pairs.length;
      answer.value = missing > 0 ? { state: "missing", n: missing } : { state: "working" };
      if (missing <= 0) begin(of, key, step);
      else asked = { key, abort: new AbortController() };
    });
  });
  return () => {
    stop();
    end();
  };
}

/** Whether what the daemon found from the pairs is what the camera has. */
export function isTaken(): boolean {
  return answer.value.state === "found" && proposal.value === null && pairs.value.length > 0 && calibration.value !== null;
}
