// Changes of the draft that this stage makes, each a step with a name. What is dragged is one step.

import type { Point } from "../../operate/orbit";
import { say } from "../../strings";
import { type AxisLine, type Calibrating, type Calibration, type Draft, type Pair, calibratingOf, calibrationOf, edit, editCalibrating, setCalibration } from "../draft";
import { calibration, chosen, half, pairs, pictureSizes, proposal, selected } from "./now";
import { type Pixel, scaled, sizeOf } from "./pairs";

let gesture = 0;
/** The step that changed what is solved, until it is solved: a calibration that follows belongs to it. */
let latest: string | null = null;

/** A key for a new gesture: what is changed under it is one step. */
export function begun(): string {
  gesture += 1;
  return `cameras:${gesture}`;
}

/** Takes the key of the last change of pairs, once. */
export function takeLatest(): string | null {
  const key = latest;
  latest = null;
  return key;
}

function change(label: string, to: (of: Calibrating) => Calibrating, key = begun()): void {
  const camera = chosen.value;
  if (!camera) return;
  latest = key;
  editCalibrating(camera.id, label, to, key);
}

const rounded = (value: number, digits: number) => Number(value.toFixed(digits));
const pixel = ([x, y]: Pixel): Pixel => [rounded(x, 2), rounded(y, 2)];
const place = ([x, y, z]: Point): Point => [rounded(x, 4), rounded(y, 4), rounded(z, 4)];

/** A click in the picture: one side of a pair, or the other of one that waits. */
export function offerPixel(at: Pixel): void {
  const waiting = half.value;
  if (waiting?.place_m) addPair({ picture_px: at, place_m: waiting.place_m });
  else half.value = { picture_px: pixel(at) };
}

/** A click in the scene. */
export function offerPlace(at: Point): void {
  const waiting = half.value;
  if (waiting?.picture_px) addPair({ picture_px: waiting.picture_px, place_m: at });
  else half.value = { place_m: place(at) };
}

export function addPair(pair: Pair): void {
  const n = pairs.value.length;
  const next = { picture_px: pixel(pair.picture_px), place_m: place(pair.place_m) };
  change(say("cameras.step.pair.add", { n: n + 1 }), (of) => ({ ...of, pairs: [...of.pairs, next] }));
  half.value = null;
  selected.value = n;
}

export function movePair(idx: number, to: Partial<Pair>, key?: string): void {
  const next = { ...(to.picture_px && { picture_px: pixel(to.picture_px) }), ...(to.place_m && { place_m: place(to.place_m) }) };
  change(say("cameras.step.pair.move", { n: idx + 1 }), (of) => ({ ...of, pairs: of.pairs.map((pair, i) => (i === idx ? { ...pair, ...next } : pair)) }), key);
}

export function removePair(idx: number): void {
  if (idx >= pairs.value.length) return;
  change(say("cameras.step.pair.remove", { n: idx + 1 }), (of) => ({ ...of, pairs: of.pairs.filter((_, i) => i !== idx) }));
  selected.value = pairs.value.length > 0 ? Math.min(idx, pairs.value.length - 1) : null;
}

export function removeAllPairs(): void {
  change(say("cameras.step.pair.removeAll"), (of) => ({ ...of, pairs: [] }));
  selected.value = null;
}

export function setWanted(wanted: Partial<Pick<Calibrating, "findsFocal" | "findsK1">>): void {
  change(say("cameras.step.wanted"), (of) => ({ ...of, ...wanted }));
}

export function addLine(line: AxisLine): void {
  change(say("cameras.step.line.add"), (of) => ({ ...of, lines: [...of.lines, { axis: line.axis, ends_px: [pixel(line.ends_px[0]), pixel(line.ends_px[1])] }] }));
}

export function moveLineEnd(idx: number, end: 0 | 1, to: Pixel, key?: string): void {
  const moved = (line: AxisLine): AxisLine => ({ ...line, ends_px: end === 0 ? [pixel(to), line.ends_px[1]] : [line.ends_px[0], pixel(to)] });
  change(say("cameras.step.line.move"), (of) => ({ ...of, lines: of.lines.map((line, i) => (i === idx ? moved(line) : line)) }), key);
}

export function removeLine(idx: number): void {
  change(say("cameras.step.line.remove"), (of) => ({ ...of, lines: of.lines.filter((_, i) => i !== idx) }));
}

/** The calibration while a camera is moved by hand; clicked points stay where they are in the picture. */
export function hold(to: Calibration, key?: string): void {
  const camera = chosen.value;
  if (!camera) return;
  proposal.value = null;
  setCalibration(camera.id, to, say("cameras.step.torch", { camera: camera.name || camera.id }), key ?? begun());
}

/** Gives a camera a calibration, and its pairs and lines the size of that calibration's picture: one step. */
export function take(camera: string, to: Calibration | null, label: string, key = begun()): void {
  edit(label, (of) => {
    const before = calibrationOf(of, camera);
    const from = before ? sizeOf(before) : pictureSizes.value[camera];
    const size = to ? sizeOf(to) : pictureSizes.value[camera];
    return withCalibration(from && size ? resized(of, camera, from, size) : of, camera, to);
  }, key);
  if (proposal.value?.camera === camera) proposal.value = null;
}

function withCalibration(of: Draft, camera: string, to: Calibration | null): Draft {
  const { document } = of.scene;
  const others = document.cameras ?? [];
  const own = to && { id: camera, calibration: to };
  const isThere = others.some(({ id }) => id === camera);
  const kept = others.flatMap((other) => (other.id === camera ? (own ? [own] : []) : [other]));
  const cameras = own && !isThere ? [...kept, own] : kept;
  return { ...of, scene: { ...of.scene, document: { ...document, cameras } } };
}

function resized(of: Draft, camera: string, from: Pixel, to: Pixel): Draft {
  const before = calibratingOf(of, camera);
  if (from[0] === to[0] && from[1] === to[1]) return of;
  const at = ([x, y]: Pixel): Pixel => [(x * to[0]) / from[0], (y * to[1]) / from[1]];
  const lines = before.lines.map((line): AxisLine => ({ ...line, ends_px: [at(line.ends_px[0]), at(line.ends_px[1])] }));
  return { ...of, calibrating: { ...of.calibrating, [camera]: { ...before, pairs: scaled(before.pairs, from, to), lines } } };
}

/** Takes over what is proposed. */
export function accept(): void {
  const [offered, camera] = [proposal.value, chosen.value];
  if (offered && camera && offered.camera === camera.id) take(camera.id, offered.calibration, taken(offered.from, camera.name || camera.id));
}

export function taken(from: "pairs" | "lines" | "import", camera: string): string {
  return say(`cameras.step.take.${from}`, { camera });
}

/** Takes the chosen camera's calibration away. */
export function forget(): void {
  const camera = chosen.value;
  if (camera && calibration.value) take(camera.id, null, say("cameras.step.forget", { camera: camera.name || camera.id }));
}
