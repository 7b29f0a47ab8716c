// The screens of a wall: how each fares, its page, and a link with a token for a screen that nobody stands before.

import { useState } from "preact/hooks";
import { api, change, content, told } from "../ask";
import { Copied } from "../parts/Copied";
import { Badge, Segments, useAsked } from "../parts/parts";
import type { Pattern } from "../screen/health";
import { session } from "../session";
import { say } from "../strings";
import { mayChange } from "./draft";
import { PATTERN_SECS, type Screen, type Told, framesApart, screenPath, showPattern, useScreens } from "./screens";

const PATTERNS = ["none", "identify", "test"] as const satisfies readonly Pattern[];
/** A screen that acknowledged nothing for so long has trouble. */
const SILENT_SECS = 5;
const LASTS = ["30", "365", "0"] as const;
const DAY_MILLIS = 86_400e3;
const SELDOM_MILLIS = 30_000;

export type Tile = { readonly id: string; readonly size_px: readonly number[] };

function State({ screens }: { screens: readonly Screen[] }) {
  const [screen] = screens;
  if (!screen) return <span class="quiet">{say("wall.screen.unheard")}</span>;
  const { frame, heard_secs, health } = screen;
  const isWell = frame !== null && heard_secs < SILENT_SECS;
  const facts = health && { rate: health.rate_hz.toFixed(1), missed: health.missed, late: health.late, reconnects: health.reconnects };
  return (
    <>
      <Badge state={isWell ? "live" : "failed"} text={say(isWell ? "wall.screen.well" : "wall.screen.troubled")} />{" "}
      <span class="quiet">
        {say("wall.screen.frame", { frame: frame ?? "–", age: heard_secs.toFixed(1) })}{facts && ` ${say("wall.screen.health", facts)}`}
        {screens.length > 1 && ` ${say("wall.screen.several", { n: screens.length })}`}
      </span>
    </>
  );
}

/** Asks for a token and shows the link that has it, this once. */
function TokenLink({ wall, tile, user, days }: { wall: string; tile: string; user: string; days: string }) {
  const [link, setLink] = useState<string | null>(null);
  const [trouble, setTrouble] = useState("");
  const make = async () => {
    const expires = days === "0" ? null : new Date(Date.now() + Number(days) * DAY_MILLIS).toISOString();
    try {
      setTrouble("");
      const body = { note: say("wall.token.note", { tile, wall }), expires_at: expires, ...(user ? { user } : {}) };
      const { token } = await change<{ token: string }>("POST", "/api/v1/tokens", body);
      setLink(`${location.origin}${screenPath(wall, tile)}#token=${token}`);
    } catch (error) {
      setTrouble(told(error));
    }
  };
  if (link !== null) return <Copied label={say("wall.token.link", { tile })} text={link} note={say("wall.token.once")} onClose={() => setLink(null)} />;
  return (
    <>
      <button type="button" onClick={() => void make()} aria-label={say("wall.token.make.of", { tile })}>{say("wall.token.make")}</button>
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
    </>
  );
}

/** What the wall's screens show, wherever they are, and whether they are in step. */
function Patterns({ wall, known }: { wall: string; known: Told | undefined }) {
  const [trouble, setTrouble] = useState("");
  const choose = async (pattern: Pattern) => {
    setTrouble("");
    await showPattern(wall, pattern).catch((error: unknown) => setTrouble(told(error)));
  };
  const screens = known?.screens ?? [];
  const apart = framesApart(screens);
  const inStep = screens.length < 2 ? "" : apart <= 1 ? ` ${say("wall.screens.inStep")}` : ` ${say("wall.screens.apart", { frames: apart })}`;
  return (
    <div class="choices">
      {mayChange.value && (
        <Segments name={`pattern-${wall}`} label={say("wall.pattern")} values={PATTERNS} chosen={known?.pattern.shows ?? "none"}
          text={(pattern) => say(`wall.pattern.${pattern}`)} onChoose={(pattern) => void choose(pattern)} />
      )}
      <p class="quiet">
        {screens.length > 0 ? say("wall.screens.connected", { n: screens.length }) : say("wall.screens.none")}{inStep}{" "}
        {mayChange.value && say("wall.pattern.help", { minutes: PATTERN_SECS / 60 })}
      </p>
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
    </div>
  );
}

/** The same, of a wall in a list. */
export function PatternsOf({ wall }: { wall: string }) {
  return <Patterns wall={wall} known={useScreens(wall).data} />;
}

export function Screens({ wall, tiles }: { wall: string; tiles: readonly Tile[] }) {
  const isAdmin = session.value?.role === "admin";
  const hasUsers = session.value?.user != null;
  const users = useAsked(async () => (isAdmin && hasUsers ? (await content(api.GET("/api/v1/users"))).users : []), SELDOM_MILLIS);
  const [user, setUser] = useState("");
  const [days, setDays] = useState<(typeof LASTS)[number]>("365");
  const known = useScreens(wall).data;
  return (
    <section class="card" aria-label={say("wall.screens")}>
      <h2>{say("wall.screens")}</h2>
      <p class="quiet">{say("wall.help")}</p>
      <Patterns wall={wall} known={known} />
      {hasUsers ? (
        <div class="choices">
          {isAdmin && (
            <label class="inline">
              {say("wall.token.user")}{" "}
              <select value={user} onChange={(event) => setUser(event.currentTarget.value)}>
                <option value="">{say("wall.token.own")}</option>
                {(users.data ?? []).map(({ id, role }) => <option key={id} value={id}>{id} ({role})</option>)}
              </select>
            </label>
          )}
          <label class="inline">
            {say("wall.token.lasts")}{" "}
            <select value={days} onChange={(event) => setDays(LASTS.find((known) => known === event.currentTarget.value) ?? "365")}>
              {LASTS.map((value) => <option key={value} value={value}>{say(`wall.token.lasts.${value}`)}</option>)}
            </select>
          </label>
          <p class="quiet">{say("wall.token.help")}</p>
        </div>
      ) : <p class="quiet">{say("wall.token.noUsers")}</p>}
      <ul class="screen-list">
        {tiles.map(({ id, size_px: [width = 0, height = 0] }) => (
          <li key={id}>
            <a href={screenPath(wall, id)} target="_blank" rel="noreferrer" aria-label={say("wall.tile", { tile: id, wall, width, height })}>
              {id}
            </a>
            <span class="quiet">{width} × {height}</span>
            <span class="screen-state"><State screens={(known?.screens ?? []).filter(({ tile }) => tile === id)} /></span>
            {hasUsers && <TokenLink wall={wall} tile={id} user={user} days={days} />}
          </li>
        ))}
      </ul>
    </section>
  );
}
