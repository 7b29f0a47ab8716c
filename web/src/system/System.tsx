// System: how the daemon and its cameras fare, what is stored, what happened, who may do what, and what exactness costs. Each part is
// loaded when it is opened.

import "../parts/forms.css";
import "./system.css";
import { signal } from "@preact/signals";
import type { ComponentType } from "preact";
import { useEffect } from "preact/hooks";
import { told } from "../ask";
import { print, route } from "../route";
import { session } from "../session";
import { say } from "../strings";
import { watchHealth } from "./health";

const PARTS = ["cameras", "load", "storage", "events", "users", "audit", "accuracy", "plan"] as const;
type PartName = (typeof PARTS)[number];

/** What only admins may ask for. */
const OF_ADMINS: readonly PartName[] = ["users", "audit"];

const LOADERS: Record<PartName, () => Promise<{ default: ComponentType }>> = {
  cameras: () => import("./Cameras"),
  load: () => import("./Load"),
  storage: () => import("./Storage"),
  events: () => import("./Events"),
  users: () => import("./users/Users"),
  audit: () => import("./Audit"),
  accuracy: () => import("./accuracy/Accuracy"),
  plan: () => import("./Plan"),
};
const loaded = signal<Partial<Record<PartName, ComponentType>>>({});
const failed = signal<string | null>(null);

async function load(part: PartName): Promise<void> {
  if (loaded.value[part]) return;
  try {
    const { default: component } = await LOADERS[part]();
    loaded.value = { ...loaded.value, [part]: component };
    failed.value = null;
  } catch (error) {
    failed.value = told(error);
  }
}

export default function System() {
  const isAdmin = session.value?.role === "admin";
  const parts = PARTS.filter((part) => isAdmin || !OF_ADMINS.includes(part));
  const part = parts.find((known) => known === route.value.details["part"]) ?? "cameras";
  useEffect(() => void load(part), [part]);
  useEffect(watchHealth, []);
  const Content = loaded.value[part];
  return (
    <div class="column system">
      <h1>{say("system.title")}</h1>
      <nav class="parts" aria-label={say("system.parts")}>
        {parts.map((name) => (
          <a key={name} href={print({ place: "system", details: { part: name } })} aria-current={name === part ? "page" : undefined}>{say(`system.part.${name}`)}</a>
        ))}
      </nav>
      {Content ? <Content /> : failed.value !== null ? (
        <p class="trouble" role="alert">{say("place.failed")} <button type="button" onClick={() => location.reload()}>{say("place.again")}</button></p>
      ) : <p class="quiet">{say("place.loading")} …</p>}
    </div>
  );
}
