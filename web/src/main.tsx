// Puts the page together: who looks, the four places, and whether the daemon answers.

import "./styles.css";
import { signal } from "@preact/signals";
import { type ComponentType, render } from "preact";
import { useEffect } from "preact/hooks";
import { told } from "./ask";
import { lostSince, watch } from "./connection";
import { dependOn } from "./depend";
import { LogIn } from "./LogIn";
import * as state from "./operate/state";
import { PLACES, type Place, followAddress, route, wayTo } from "./route";
import { learnWho, logOut, session } from "./session";
import { say } from "./strings";
import { THEMES, applyTheme, chooseTheme, theme } from "./theme";
import { tick } from "./tick";

/** A place that is not open is not loaded. */
const LOADERS: Record<Place, () => Promise<{ default: ComponentType }>> = {
  operate: () => import("./operate/Operate"),
  setup: () => import("./setup/Setup"),
  wall: () => import("./walls/Walls"),
  system: () => import("./system/System"),
};
const loaded = signal<Partial<Record<Place, ComponentType>>>({});
const failed = signal<string | null>(null);

async function load(place: Place): Promise<void> {
  if (loaded.value[place]) return;
  try {
    const { default: component } = await LOADERS[place]();
    loaded.value = { ...loaded.value, [place]: component };
    failed.value = null;
  } catch (error) {
    failed.value = told(error);
  }
}

function Connection() {
  dependOn(tick);
  const lost = lostSince.value;
  // Always there, so that what comes into it is read out.
  return (
    <div role="alert" class="connection">
      {lost !== null && <p class="trouble">{say("connection.lost", { seconds: Math.round((performance.now() - lost) / 1e3) })}</p>}
    </div>
  );
}

function Head() {
  const who = session.value;
  return (
    <header class="bar">
      <a class="skip" href="#content" onClick={(event) => {
        event.preventDefault();
        document.querySelector<HTMLElement>("main")?.focus();
      }}>{say("app.skip")}</a>
      <p class="brand"><img src="/icon.svg" alt="" width="26" height="26" /><span>{say("app.name")}</span></p>
      <nav aria-label={say("app.places")}>
        {PLACES.map((place) => (
          <a key={place} href={wayTo(place)} aria-current={route.value.place === place ? "page" : undefined}>{say(`place.${place}`)}</a>
        ))}
      </nav>
      <label class="inline theme">
        <span class="hidden">{say("theme.label")}</span>
        <select value={theme.value} onChange={(event) => chooseTheme(THEMES.find((known) => known === event.currentTarget.value) ?? "system")}>
          {THEMES.map((value) => <option key={value} value={value}>{say(`theme.${value}`)}</option>)}
        </select>
      </label>
      {who?.user != null && <button type="button" onClick={() => void logOut()}>{say("login.out", { user: who.user })}</button>}
    </header>
  );
}

function Page() {
  const { place } = route.value;
  useEffect(() => void load(place), [place]);
  const who = session.value;
  const Content = loaded.value[place];
  const isKnown = who !== undefined && who.role !== null;
  return (
    <>
      <Head />
      <Connection />
      <main id="content" tabIndex={-1} data-place={place}>
        {isKnown && Content && <Content />}
        {isKnown && !Content && failed.value !== null && (
          <p class="trouble" role="alert">
            {say("place.failed")} <button type="button" onClick={() => location.reload()}>{say("place.again")}</button>
          </p>
        )}
        {(who === undefined || (isKnown && !Content && failed.value === null)) && <p class="quiet">{say("place.loading")} …</p>}
      </main>
      {who?.role === null && <LogIn />}
    </>
  );
}

function Title() {
  const name = route.value.place === "operate" ? state.scene.value?.name : undefined;
  const title = `${name ?? say(`place.${route.value.place}`)} · ${say("app.name")}`;
  useEffect(() => {
    document.title = title;
  }, [title]);
  return null;
}

applyTheme();
followAddress(state.arrived);
const page = document.querySelector("#page");
if (page) render(<><Title /><Page /></>, page);
void watch();
void learnWho();
void state.follow();
