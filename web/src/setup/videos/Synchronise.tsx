// Two cameras side by side: one moment found in both pictures sets the second's clock.

import { useEffect, useState } from "preact/hooks";
import * as state from "../../operate/state";
import { say } from "../../strings";
import { type DraftCamera, draft, editCamera, isReadOnly } from "../draft";
import { type SceneTime, type Way, aheadSecs, inStep, waysOf } from "./moment";
import { Player, firstLook } from "./Player";

/** Less than this is in step: no frame is known better. */
const LEVEL_SECS = 0.0005;

function isRunning({ id }: DraftCamera): boolean {
  return state.cameras.value?.some((camera) => camera.id === id && camera.last !== null) ?? false;
}

function Choice({ label, cameras, chosen, onChoose }: { label: string; cameras: readonly DraftCamera[]; chosen: DraftCamera; onChoose: (id: string) => void }) {
  return (
    <label class="inline">
      {label}{" "}
      <select value={chosen.id} onChange={(event) => onChoose(event.currentTarget.value)}>
        {cameras.map(({ id, name }) => <option key={id} value={id}>{name || id}</option>)}
      </select>
    </label>
  );
}

function aheadWords(ahead: number, first: DraftCamera, second: DraftCamera): string {
  const names = { first: first.name || first.id, second: second.name || second.id };
  if (Math.abs(ahead) < LEVEL_SECS) return say("sync.level");
  return say(ahead > 0 ? "sync.ahead" : "sync.behind", { ...names, secs: Math.abs(ahead).toFixed(3) });
}

function SideBySide({ pair: [first, second], ways }: { pair: readonly [DraftCamera, DraftCamera]; ways: readonly [Way, Way] }) {
  const [at, setAt] = useState<readonly [number, number]>([firstLook(first, ways[0]), firstLook(second, ways[1])]);
  const [times, setTimes] = useState<readonly [SceneTime | null, SceneTime | null]>([null, null]);
  const [one, other] = times;
  const ahead = one && other ? aheadSecs(one, other) : null;
  const same = () => {
    if (ahead === null) return;
    editCamera(second.id, say("step.clock", { name: second.name || second.id }), (of) => ({ ...of, clock: inStep(of.clock, ahead) }));
  };
  return (
    <>
      <div class="players">
        <Player camera={first} way={ways[0]} at={at[0]} onAt={(secs) => setAt(([, b]) => [secs, b])} onTime={(time) => setTimes(([, b]) => [time, b])} />
        <Player camera={second} way={ways[1]} at={at[1]} onAt={(secs) => setAt(([a]) => [a, secs])} onTime={(time) => setTimes(([a]) => [a, time])} />
      </div>
      <div class="row">
        <p role="status">{ahead === null ? say("sync.waiting") : aheadWords(ahead, first, second)}</p>
        <button type="button" class="is-main push" disabled={ahead === null || Math.abs(ahead) < LEVEL_SECS || isReadOnly.value} onClick={same}>
          {say("sync.same")}
        </button>
      </div>
    </>
  );
}

function Pair({ cameras }: { cameras: readonly DraftCamera[] }) {
  const [wanted, setWanted] = useState<readonly [string | undefined, string | undefined]>([undefined, undefined]);
  const first = cameras.find(({ id }) => id === wanted[0]) ?? cameras[0];
  const others = cameras.filter((camera) => camera !== first);
  const second = others.find(({ id }) => id === wanted[1]) ?? others[0];
  if (!first || !second) return null;
  const ways = waysOf({ camera: first, isRunning: isRunning(first) }, { camera: second, isRunning: isRunning(second) });
  return (
    <>
      <div class="row">
        <Choice label={say("sync.first")} cameras={cameras} chosen={first} onChoose={(id) => setWanted([id, second.id === id ? first.id : second.id])} />
        <Choice label={say("sync.second")} cameras={others} chosen={second} onChoose={(id) => setWanted([first.id, id])} />
      </div>
      {ways ? <SideBySide key={`${first.id} ${second.id} ${ways.join(" ")}`} pair={[first, second]} ways={ways} /> : <p class="note">{say("sync.unlike")}</p>}
    </>
  );
}

export function Synchronise() {
  const [isOpen, setOpen] = useState(false);
  const cameras = draft.value?.cameras ?? [];
  const isPossible = cameras.length > 1;
  useEffect(() => {
    if (!isPossible) setOpen(false);
  }, [isPossible]);
  return (
    <details class="card fold" open={isOpen} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary><h2>{say("sync.title")}</h2></summary>
      <p class="quiet">{say(isPossible ? "sync.help" : "sync.few")}</p>
      {isOpen && isPossible && <Pair cameras={cameras} />}
    </details>
  );
}
