// What the caller may do, so that nothing else is offered. The daemon decides by itself, whatever is shown here.

import { computed, effect, signal } from "@preact/signals";
import { api, content } from "../ask";
import { session } from "../session";
import * as state from "./state";

export type Right = "live" | "history" | "export" | "manage";
type Grants = Readonly<Record<string, readonly string[]>>;

/** Rights by camera, `*` those of all; null where everything is allowed or nothing is known yet. */
const grants = signal<Grants | null>(null);

effect(() => {
  const who = session.value;
  grants.value = null;
  if (!who?.user || who.role === "admin" || who.role === null) return;
  const path = { id: who.user };
  void content(api.GET("/api/v1/users/{id}", { params: { path } })).then(
    (user) => {
      if (session.value?.user === who.user) grants.value = user.cameras;
    },
    // Then more is offered than may be; the daemon refuses it and says why.
    () => null,
  );
});

/** Ids of all cameras, as one text, so that what hangs on it does not run again whenever they are told anew. */
const configured = computed(() => state.cameras.value?.map(({ id }) => id).join(" "));

/** Whether the caller may do that with a camera. */
export function may(right: Right, camera: string): boolean {
  const known = grants.value;
  if (!known) return true;
  return [...(known["*"] ?? []), ...(known[camera] ?? [])].includes(right);
}

/** Whether the caller may change what all share: views, playheads, snapshots. */
export function isOperator(): boolean {
  return session.value?.role === "operator" || session.value?.role === "admin";
}

/** Whether the caller may take an export back or remove it: operators their own, admins any. */
export function mayRemove(one: { readonly asked_by: string | null }): boolean {
  const who = session.value;
  return who?.role === "admin" || (isOperator() && one.asked_by !== null && one.asked_by === who?.user);
}

/** Those cameras of the scene of which the caller may do that. A scene may name some that the daemon does not have. */
export function allowed(right: Right): string[] {
  const known = configured.value;
  return (state.scene.value?.cameras ?? []).filter((camera) => may(right, camera) && (known?.split(" ").includes(camera) ?? true));
}
