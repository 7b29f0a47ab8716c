// Where the viewer is, in the address behind `#`: `#/operate?scene=plaza&camera=west&at=...`. So reloading keeps it, the
// browser's buttons go through it, and no server hears of it.

import { signal } from "@preact/signals";

export const PLACES = ["operate", "setup", "wall", "system"] as const;
export type Place = (typeof PLACES)[number];
export type Details = Readonly<Record<string, string>>;
export type Route = { readonly place: Place; readonly details: Details };

/** What an address says; Operate where it says nothing that is known. */
export function parse(hash: string): Route {
  const [path = "", query = ""] = hash.replace(/^#\/?/, "").split("?");
  const place = PLACES.find((known) => known === path) ?? "operate";
  return { place, details: Object.fromEntries(new URLSearchParams(query)) };
}

/** The address of a route. Commas and colons stay readable. */
export function print({ place, details }: Route): string {
  const query = new URLSearchParams(details).toString().replaceAll("%2C", ",").replaceAll("%3A", ":");
  return `#/${place}${query ? `?${query}` : ""}`;
}

/** Where the viewer is. */
export const route = signal<Route>(parse(typeof location === "undefined" ? "" : location.hash));

/** Where the viewer was last in every place, so that going back finds it as it was left. */
const last = new Map<Place, Route>([[route.value.place, route.value]]);

function arrive(next: Route): void {
  last.set(next.place, next);
  route.value = next;
}

/** The address that leads to a place as it was left, but for these details. */
export function wayTo(place: Place, details: Details = {}): string {
  return print({ place, details: { ...last.get(place)?.details, ...details } });
}

/** Changes details of the place that is shown (null takes one away); as a step that "back" undoes if `isStep`. */
export function change(details: Record<string, string | null>, isStep = false): void {
  const { place, details: before } = route.value;
  const merged = Object.entries({ ...before, ...details }).filter((entry): entry is [string, string] => entry[1] !== null);
  const next = { place, details: Object.fromEntries(merged) };
  const text = print(next);
  if (text === print(route.value)) return;
  if (isStep) history.pushState(null, "", text);
  else history.replaceState(null, "", text);
  arrive(next);
}

/** Follows the browser's buttons and links, and calls `then` after each. */
export function followAddress(then: () => void): void {
  const follow = () => {
    if (location.hash === print(route.value)) return;
    arrive(parse(location.hash));
    then();
  };
  addEventListener("hashchange", follow);
  addEventListener("popstate", follow);
}
