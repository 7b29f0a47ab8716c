// What a camera's source shows: the live picture of one that runs, else one picture of the source as it is written, with what it is.

import { useEffect, useRef, useState } from "preact/hooks";
import { CameraPicture } from "../../operate/CameraPicture";
import * as state from "../../operate/state";
import { Badge } from "../../parts/parts";
import { say, sayWord } from "../../strings";
import { equal } from "../changes";
import { type DraftCamera, base, isReadOnly } from "../draft";
import type { Newest } from "../newest";
import { hasPlace } from "../stages";
import { kindOf, placeOf } from "./edits";
import { type Looked, useLook } from "./look";
import { timecode } from "./Scrubber";

const LIVE_MILLIS = 250;

/** Whether the daemon shows the camera with the source that the draft has. Files are looked into nevertheless, by who may. */
export function isShownLive({ id, source }: DraftCamera): boolean {
  const kept = base.value?.cameras.find((camera) => camera.id === id);
  const isRunning = state.cameras.value?.some((camera) => camera.id === id) ?? false;
  return kept !== undefined && isRunning && (!source.path || isReadOnly.value) && equal(placeOf(kept.source), placeOf(source));
}

/** Looks at a camera's source as it is written. Addresses are looked at when asked for (`ask`): half of one is another host. */
export function useSource(camera: DraftCamera, atSecs: number): { looked: Newest<Looked>; ask: () => void } {
  const { source } = camera;
  const [asked, setAsked] = useState({ url: source.url, round: 0 });
  const latest = useRef(source);
  latest.current = source;
  const isWanted = hasPlace(camera) && !isShownLive(camera) && (kindOf(source) !== "url" || asked.url === source.url);
  const looked = useLook(isWanted ? placeOf(source) : null, atSecs, asked.round);
  return { looked, ask: () => setAsked(({ round }) => ({ url: latest.current.url, round: round + 1 })) };
}

function LookFacts({ size_px: [width, height], rate_hz, codec, duration_secs }: Looked) {
  const facts = [
    say("videos.look.size", { width, height }),
    ...(rate_hz === null ? [] : [say("videos.look.rate", { rate: Number(rate_hz.toFixed(2)) })]),
    ...(codec === null ? [] : [codec]),
    ...(duration_secs === null ? [] : [say("videos.look.secs", { secs: timecode(duration_secs) })]),
  ];
  return <p class="quiet" role="status">{facts.join(" · ")}</p>;
}

function Still({ name, looked, isEmpty }: { name: string; looked: Newest<Looked>; isEmpty: boolean }) {
  // While the next picture is on its way, the last one stays.
  const [shown, setShown] = useState<Looked | null>(looked.value);
  useEffect(() => {
    if (looked.value || looked.trouble || isEmpty) setShown(looked.value);
  }, [looked.value, looked.trouble, isEmpty]);
  return (
    <>
      <div class="look" aria-busy={looked.isAsking}>
        {shown && <img src={shown.url} alt={say("videos.look.alt", { name })} draggable={false} />}
        {!shown && <p>{say(isEmpty ? "videos.look.none" : looked.trouble ? "videos.look.failed" : "videos.look.asking")}</p>}
        {shown && looked.isAsking && <span class="stamp">{say("videos.look.asking")}</span>}
      </div>
      {shown && <LookFacts {...shown} />}
    </>
  );
}

export function SourcePicture({ camera, looked }: { camera: DraftCamera; looked: Newest<Looked> }) {
  const running = state.cameras.value?.find(({ id }) => id === camera.id);
  const name = camera.name || camera.id;
  const isLive = running !== undefined && isShownLive(camera);
  const word = running && state.stateOf(running);
  return (
    <div class="source-picture">
      {isLive
        ? <div class="look"><CameraPicture camera={running} kind="frame" at={null} everyMillis={LIVE_MILLIS} /></div>
        : <Still name={name} looked={looked} isEmpty={!looked.value && !looked.trouble && !looked.isAsking} />}
      {running && word !== undefined && (
        <p class="quiet">
          <Badge state={word} text={say("videos.state", { state: sayWord("state", word) })} /> {running.reason}
        </p>
      )}
    </div>
  );
}
