// The scene from above, north up: its cameras with what they see of the ground, people, the viewer. As large as its place allows.

import { useEffect, useRef, useState } from "preact/hooks";
import { ask } from "../ask";
import { say, sayWord } from "../strings";
import { jumpInto } from "./jumping";
import { type MapPlace, type Size, panned, toPixel, toWorld, whole, zoomedAt } from "./mapscale";
import { instant } from "./moments";
import { axes } from "./orbit";
import { aboutPerson, toggleFollow } from "./Overlay";
import { cones, extent, groundAt, lenses } from "./scenery";
import * as state from "./state";
import { people } from "./tracking";
import { stoodAt } from "./ways";

/** The ground changes slowly. */
const AGAIN_MILLIS = 15_000;
const REST_MILLIS = 200;
/** The picture shows this much more on every side, so that moving does not show emptiness. */
const MARGIN = 1.4;
const CLICK_PIXELS = 5;
const MOST_COLUMNS = 1_400;
const FROM_ABOVE_M = 1e4;

type Picture = { place: MapPlace; size: Size; url: string };

/** Asks for the ground of `place` whenever that rests, and now and then. */
function useGround(place: MapPlace | null, size: Size): Picture | null {
  const [picture, setPicture] = useState<Picture | null>(null);
  const scene = state.scene.value?.id;
  const at = state.at.value;
  // The picture of the scene comes first: both are drawn one after the other.
  const isLater = state.shown.value !== null;
  const text = JSON.stringify([isLater, place, size, scene, at === null ? null : Math.floor(at / AGAIN_MILLIS)]);
  useEffect(() => {
    if (!isLater || !place || scene === undefined || size[0] < 16) return undefined;
    const ending = new AbortController();
    const wanted: MapPlace = { center: place.center, across: place.across * MARGIN };
    const columns = Math.min(Math.round(size[0] * MARGIN * devicePixelRatio), MOST_COLUMNS);
    const learn = async () => {
      if (document.hidden) return;
      const query = {
        projection: "map", target: `${wanted.center.map((metres) => metres.toFixed(3)).join(",")},0`, across: wanted.across.toFixed(3),
        width: columns, height: Math.max(16, Math.round((columns * size[1]) / size[0])), entities: "none", quality: "draft",
        t: at === null ? null : instant(at),
      };
      try {
        const response = await ask(`/api/v1/scenes/${encodeURIComponent(scene)}/view.jpg`, query, { signal: ending.signal });
        const url = await decoded(response);
        if (ending.signal.aborted) URL.revokeObjectURL(url);
        else setPicture({ place: wanted, size, url });
      } catch {
        // The picture beside it says what is wrong; the map goes on with what it has.
      }
    };
    const soon = setTimeout(() => void learn(), REST_MILLIS);
    const again = setInterval(() => void learn(), AGAIN_MILLIS);
    return () => {
      ending.abort();
      clearTimeout(soon);
      clearInterval(again);
    };
  }, [text]);
  useEffect(() => () => {
    if (picture) URL.revokeObjectURL(picture.url);
  }, [picture]);
  return picture;
}

/** The address of a response's picture, once it can be shown at once. */
async function decoded(response: Response): Promise<string> {
  const url = URL.createObjectURL(await response.blob());
  const image = new Image();
  image.src = url;
  await image.decode().catch(() => null);
  return url;
}

function press(then: () => void) {
  return {
    onClick: then,
    onKeyDown: (event: KeyboardEvent) => {
      if (event.key !== "Enter" && event.key !== " ") return;
      event.preventDefault();
      event.stopPropagation();
      then();
    },
  };
}

function Cone({ id, at }: { id: string; at: (point: readonly [number, number, ...number[]]) => readonly [number, number] }) {
  const lens = lenses.value.get(id);
  const camera = state.cameras.value?.find((known) => known.id === id);
  if (!lens || !camera) return null;
  const word = state.stateOf(camera);
  const corners = (cones.value.get(id) ?? []).map((corner) => at(corner).map((pixel) => pixel.toFixed(1)).join(",")).join(" ");
  const [x, y] = at(lens.position);
  const sees = followedCameras().includes(id);
  return (
    <g class={`cone ${sees ? "is-seeing" : ""}`} data-state={word} data-camera={id} tabindex={0} role="button" data-own
      aria-label={say("map.camera", { name: camera.name, state: sayWord("state", word) })} {...press(() => void jumpInto(id))}>
      <polygon points={corners} />
      <circle cx={x} cy={y} r="5" />
      <text x={x} y={y - 9}>{camera.name}</text>
    </g>
  );
}

/** Cameras that see whom the viewer follows. */
const followedCameras = () => people.value.get(state.followed.value ?? "")?.cameras ?? [];

export function MapView({ isLarge }: { isLarge: boolean }) {
  const box = useRef<HTMLDivElement>(null);
  const [size, setSize] = useState<Size>([0, 0]);
  const [chosen, setChosen] = useState<MapPlace | null>(null);
  const place = size[0] > 0 ? (chosen ?? whole(extent.value, size)) : null;
  const latest = useRef({ place, size });
  latest.current = { place, size };
  const picture = useGround(place, size);
  useEffect(() => setChosen(null), [state.scene.value?.id]);
  useEffect(() => {
    const element = box.current;
    if (!element) return undefined;
    const sizes = new ResizeObserver(() => setSize([element.clientWidth, element.clientHeight]));
    sizes.observe(element);
    const detach = attach(element, () => latest.current, setChosen);
    return () => {
      sizes.disconnect();
      detach();
    };
  }, []);
  const at = (point: readonly [number, number, ...number[]]) => (place ? toPixel(place, size, point) : ([0, 0] as const));
  const view = state.shown.value?.view ?? state.looking.value;
  return (
    // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex -- it takes keys
    <div ref={box} class={`map ${isLarge ? "is-large" : ""}`} role="group" tabIndex={0} data-own aria-label={say("map.label")} title={say("map.help")}>
      {place && (
        <svg width={size[0]} height={size[1]}>
          {picture && <image href={picture.url} preserveAspectRatio="none" {...ground(picture, place, size)} />}
          {(state.scene.value?.cameras ?? []).map((id) => <Cone key={id} id={id} at={at} />)}
          {state.labels.value === "on" && [...people.value.values()].map((person) => {
            const [x, y] = at(person.position);
            return (
              <g key={person.id} class={`walker ${person.id === state.followed.value ? "is-followed" : ""} ${person.isLost ? "is-lost" : ""}`}
                tabindex={isLarge ? 0 : -1} role="button" data-own aria-label={aboutPerson(person)} {...press(() => toggleFollow(person.id))}>
                {state.trails.value === "on" && <polyline points={person.trail.map(({ position }) => at(position).map((pixel) => pixel.toFixed(1)).join(",")).join(" ")} />}
                <circle cx={x} cy={y} r="5" />
                <text x={x + 8} y={y + 4}>{person.id}</text>
              </g>
            );
          })}
          {state.mark.value && <circle class="marked" cx={at(state.mark.value)[0]} cy={at(state.mark.value)[1]} r="5" />}
          {view && <Viewer spot={at(view.eye)} angle={bearing(view)} />}
        </svg>
      )}
    </div>
  );
}

/** Where the viewer stands and looks; dragging it takes the viewer along. */
function Viewer({ spot: [x, y], angle }: { spot: readonly [number, number]; angle: number }) {
  return (
    <g class="viewer" data-viewer transform={`translate(${x.toFixed(1)} ${y.toFixed(1)}) rotate(${angle.toFixed(1)})`}>
      <path d="M0 0 L-14 -30 A33 33 0 0 1 14 -30 Z" />
      <circle r="6" />
    </g>
  );
}

/** Degrees from the top of the map, clockwise. */
function bearing(view: Parameters<typeof axes>[0]): number {
  const { forward } = axes(view);
  return (Math.atan2(forward[0], forward[1]) * 180) / Math.PI;
}

/** Where the picture of the ground lies while the map is elsewhere already. */
function ground({ place: drawn, size: drawnSize }: Picture, place: MapPlace, size: Size): { x: number; y: number; width: number; height: number } {
  const scale = size[0] / place.across;
  const width = drawn.across * scale;
  const height = (width * drawnSize[1]) / drawnSize[0];
  const [x, y] = toPixel(place, size, drawn.center);
  return { width, height, x: x - width / 2, y: y - height / 2 };
}

const KEYS: Record<string, (place: MapPlace, size: Size) => MapPlace> = {
  ArrowLeft: (place, size) => panned(place, size, size[0] * 0.1, 0),
  ArrowRight: (place, size) => panned(place, size, -size[0] * 0.1, 0),
  ArrowUp: (place, size) => panned(place, size, 0, size[0] * 0.1),
  ArrowDown: (place, size) => panned(place, size, 0, -size[0] * 0.1),
  "+": (place, size) => zoomedAt(place, size, [size[0] / 2, size[1] / 2], 0.8),
  "=": (place, size) => zoomedAt(place, size, [size[0] / 2, size[1] / 2], 0.8),
  "-": (place, size) => zoomedAt(place, size, [size[0] / 2, size[1] / 2], 1.25),
};

/** Pan, zoom, the viewer dragged, and places chosen. */
function attach(element: HTMLElement, now: () => { place: MapPlace | null; size: Size }, set: (place: MapPlace | null) => void): () => void {
  const ending = new AbortController();
  const { signal } = ending;
  let grabbed: { x: number; y: number; moved: number; isViewer: boolean } | null = null;
  const pixelOf = (event: MouseEvent): [number, number] => {
    const box = element.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const listen = <Name extends keyof HTMLElementEventMap>(name: Name, then: (event: HTMLElementEventMap[Name]) => void) => {
    element.addEventListener(name, (event) => {
      // The picture beneath must not hear of it.
      event.stopPropagation();
      then(event);
    }, { signal, passive: false });
  };
  listen("pointerdown", (event) => {
    const target = event.target instanceof Element ? event.target : null;
    if (target?.closest("button, [role=button]")) return;
    element.setPointerCapture(event.pointerId);
    grabbed = { x: event.clientX, y: event.clientY, moved: 0, isViewer: target?.closest("[data-viewer]") != null };
  });
  listen("pointermove", (event) => {
    const { place, size } = now();
    if (!grabbed || !place) return;
    const [dx, dy] = [event.clientX - grabbed.x, event.clientY - grabbed.y];
    grabbed = { ...grabbed, x: event.clientX, y: event.clientY, moved: grabbed.moved + Math.hypot(dx, dy) };
    if (grabbed.isViewer) drag(toWorld(place, size, pixelOf(event)));
    else if (grabbed.moved > CLICK_PIXELS) set(panned(place, size, dx, dy));
  });
  listen("pointerup", (event) => {
    const { place, size } = now();
    if (grabbed && !grabbed.isViewer && grabbed.moved <= CLICK_PIXELS && place) {
      const [x, y] = toWorld(place, size, pixelOf(event));
      state.setMark([x, y, groundAt(x, y, FROM_ABOVE_M)]);
    }
    grabbed = null;
  });
  listen("pointercancel", () => (grabbed = null));
  listen("dblclick", (event) => {
    const { place, size } = now();
    const view = state.view.peek();
    if (!place || !view) return;
    const [x, y] = toWorld(place, size, pixelOf(event));
    state.setView(stoodAt(view, [x, y, groundAt(x, y, FROM_ABOVE_M)]));
    state.choose("move", "walk", "orbit");
  });
  listen("wheel", (event) => {
    const { place, size } = now();
    event.preventDefault();
    const pixels = event.deltaY * (event.deltaMode === WheelEvent.DOM_DELTA_PIXEL ? 1 : 30);
    if (place) set(zoomedAt(place, size, pixelOf(event), Math.exp(Math.max(-300, Math.min(300, pixels)) * 0.0015)));
  });
  element.addEventListener("keydown", (event) => {
    const { place, size } = now();
    const key = KEYS[event.key];
    if (event.target !== element || !place || event.ctrlKey || event.altKey || event.metaKey) return;
    if (key) set(key(place, size));
    else if (event.key === "0") set(null);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }, { signal });
  return () => ending.abort();
}

/** Takes the viewer, with what they look at, over the ground. */
function drag([x, y]: readonly [number, number]): void {
  const view = state.view.peek();
  if (!view) return;
  const by = [x - view.eye[0], y - view.eye[1]] as const;
  state.setView({ ...view, eye: [x, y, view.eye[2]], target: [view.target[0] + by[0], view.target[1] + by[1], view.target[2]] });
}
