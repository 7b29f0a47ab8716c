// The screens of a wall: how each fares, its page, and a link with a token for a screen that nobody stands before.

import { useState } from "preact/hooks";
import { api, change, content, told } from "../ask";
import { Badge, Segments, useAsked } from "../parts/parts";
import type { Health, Pattern } from "../screen/channel";
import { session } from "../session";
import { say } from "../strings";
import { Copied } from "../parts/Copied";
import { heard, screenPath, showPattern } from "./screens";

const PATTERNS = ["none", "identify", "test"] as const satisfies readonly Pattern[];
const LASTS = ["30", "365", "0"] as const;
const DAY_MILLIS = 86_400e3;
const SELDOM_MILLIS = 30_000;

export type Screen = { readonly id: string; readonly size_px: readonly number[] };

function State({ healths }: { healths: readonly Health[] }) {
  const [health] = healths;
  if (!health) return <span class="quiet">{say("wall.screen.unheard")}</span>;
  const isWell = health.trouble === "" && health.frame !== null;
  const facts = {
    frame: health.frame ?? "–", rate: health.rate.toFixed(1), wanted: health.wantedRate, age: ((health.ageMillis ?? 0) / 1e3).toFixed(1),
    missed: health.missed, late: health.late, reconnects: health.reconnects,
  };
  return (
    <>
      <Badge state={isWell ? "live" : "failed"} text={say(isWell ? "wall.screen.well" : "wall.screen.troubled")} />{" "}
      <span class="quiet">{say("wall.screen.health", facts)}{healths.length > 1 ? ` ${say("wall.screen.several", { n: healths.length })}` : ""} {health.trouble}</span>
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

/** Switches what the wall's screens in this browser show. */
export function Patterns({ wall }: { wall: string }) {
  const own = [...heard.value.values()].map(({ health }) => health).filter((health) => health.wall === wall);
  const chosen = PATTERNS.find((pattern) => own.length > 0 && own.every((health) => health.pattern === pattern));
  return (
    <div class="choices">
      <Segments name={`pattern-${wall}`} label={say("wall.pattern")} values={PATTERNS} chosen={chosen ?? "none"} text={(pattern) => say(`wall.pattern.${pattern}`)}
        onChoose={(pattern) => showPattern(wall, pattern)} />
      <p class="quiet">{say(own.length > 0 ? "wall.pattern.heard" : "wall.pattern.help", { n: own.length })}</p>
    </div>
  );
}

export function Screens({ wall, screens }: { wall: string; screens: readonly Screen[] }) {
  const isAdmin = session.value?.role === "admin";
  const hasUsers = session.value?.user != null;
  const users = useAsked(async () => (isAdmin && hasUsers ? (await content(api.GET("/api/v1/users"))).users : []), SELDOM_MILLIS);
  const [user, setUser] = useState("");
  const [days, setDays] = useState<(typeof LASTS)[number]>("365");
  const all = [...heard.value.values()].map(({ health }) => health);
  return (
    <section class="card" aria-label={say("wall.screens")}>
      <h2>{say("wall.screens")}</h2>
      <p class="quiet">{say("wall.help")}</p>
      <Patterns wall={wall} />
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
        {screens.map(({ id, size_px: [width = 0, height = 0] }) => (
          <li key={id}>
            <a href={screenPath(wall, id)} target="_blank" rel="noreferrer" aria-label={say("wall.tile", { tile: id, wall, width, height })}>
              {id}
            </a>
            <span class="quiet">{width} × {height}</span>
            <span class="screen-state"><State healths={all.filter((health) => health.wall === wall && health.tile === id)} /></span>
            {hasUsers && <TokenLink wall={wall} tile={id} user={user} days={days} />}
          </li>
        ))}
      </ul>
    </section>
  );
}
