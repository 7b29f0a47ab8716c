// Cameras in the network that speak ONVIF: who is there, how far their clocks are off, and the streams of one, to be taken over.

import { useState } from "preact/hooks";
import { told } from "../../ask";
import { say } from "../../strings";
import { type Device, type DeviceStream, type Discovery, discoverCameras } from "../requests";

/** A stream as it is taken over: by whom it is asked for, and what its camera calls itself. */
export type ChosenStream = { readonly url: string; readonly credentials: string; readonly name: string };

type Answer = { readonly found: Discovery | null; readonly failure: string | null };

const NOTHING: Answer = { found: null, failure: null };

function shownClock({ clock }: Device): string {
  if (clock === null) return say("videos.find.clock.none");
  const secs = Math.abs(clock.secs).toFixed(1);
  if (Math.abs(clock.secs) <= clock.error_secs) return say("videos.find.clock.right");
  return say(clock.secs < 0 ? "videos.find.clock.behind" : "videos.find.clock.ahead", { secs });
}

function shownName({ name, maker, model }: Device): string {
  return [name, maker, model].filter(Boolean).join(", ") || say("videos.find.unnamed");
}

function shownStream({ profile, encoding, size_px, rate_hz }: DeviceStream): string {
  const facts = [encoding, size_px?.join(" × "), rate_hz === null ? null : `${rate_hz} Hz`].filter(Boolean).join(", ");
  return facts === "" ? profile : `${profile}: ${facts}`;
}

function Streams({ device, chosen, onChoose }: { device: Device; chosen: string; onChoose: (url: string) => void }) {
  return (
    <>
      {device.problem !== null && <p class="fault">{device.problem}</p>}
      {device.streams.map(({ url, reported_url, ...stream }, i) => (
        <label key={i} class="file">
          <input type="radio" name="found-stream" disabled={url === null} checked={url !== null && url === chosen} onChange={() => url !== null && onChoose(url)} />
          <span class="file-path">{shownStream({ url, reported_url, ...stream })}</span>
          <span class="quiet">{url ?? say("videos.find.noUrl")}{reported_url !== null && ` (${say("videos.find.told", { url: reported_url })})`}</span>
        </label>
      ))}
    </>
  );
}

/** One camera that was found. It is asked for its streams when that is wanted, as whoever the login is. */
function FoundCamera({ device, credentials, chosen, onChoose }: { device: Device; credentials: string; chosen: string; onChoose: (stream: ChosenStream) => void }) {
  const [{ found, failure }, setAnswer] = useState(NOTHING);
  const [isAsking, setAsking] = useState(false);
  // What was learned with a login is known beside what everybody was told.
  const asked = found?.devices[0];
  const whole = asked ? { ...device, ...asked, name: device.name ?? asked.name } : device;
  const [address = ""] = device.services;
  const ask = async () => {
    setAsking(true);
    setAnswer(await asAnswer(discoverCameras({ address, ...(credentials === "" ? {} : { credentials }) })));
    setAsking(false);
  };
  return (
    <li>
      <div class="row">
        <strong>{shownName(whole)}</strong>
        <span class="quiet">{address} · {shownClock(whole)}</span>
        <button type="button" disabled={isAsking} onClick={() => void ask()}>{say(isAsking ? "videos.find.asking" : "videos.find.streams")}</button>
      </div>
      {failure !== null && <p class="fault" role="status">{failure}</p>}
      <Streams device={whole} chosen={chosen} onChoose={(url) => onChoose({ url, credentials, name: whole.name ?? whole.model ?? "" })} />
    </li>
  );
}

async function asAnswer(asked: Promise<Discovery>): Promise<Answer> {
  try {
    return { found: await asked, failure: null };
  } catch (error) {
    return { found: null, failure: told(error) };
  }
}

export function CameraFinder({ chosen, onChoose }: { chosen: string; onChoose: (stream: ChosenStream) => void }) {
  const [{ found, failure }, setAnswer] = useState(NOTHING);
  const [isAsking, setAsking] = useState(false);
  const [address, setAddress] = useState("");
  const [credentials, setCredentials] = useState("");
  const search = async (where: string) => {
    setAsking(true);
    setAnswer(await asAnswer(discoverCameras(where === "" ? {} : { address: where })));
    setAsking(false);
  };
  return (
    <fieldset class="files">
      <legend>{say("videos.find")}</legend>
      <p class="quiet">{say("videos.find.help")}</p>
      <div class="row">
        <button type="button" disabled={isAsking} onClick={() => void search("")}>{say(isAsking ? "videos.find.asking" : "videos.find.search")}</button>
        <input type="text" aria-label={say("videos.find.address")} placeholder={say("videos.find.address")} value={address} spellcheck={false}
          onInput={(event) => setAddress(event.currentTarget.value.trim())} />
        <button type="button" disabled={isAsking || address === ""} onClick={() => void search(address)}>{say("videos.find.ask")}</button>
        {found && found.credentials.length > 0 && (
          <label class="inline">
            {say("videos.find.credentials")}
            <select value={credentials} onChange={(event) => setCredentials(event.currentTarget.value)}>
              <option value="">{say("videos.find.nobody")}</option>
              {found.credentials.map((id) => <option key={id} value={id}>{id}</option>)}
            </select>
          </label>
        )}
      </div>
      {failure !== null && <p class="fault" role="status">{failure}</p>}
      {found && (
        <ul class="found" aria-label={say("videos.find.found")}>
          {found.devices.map((device) => (
            <FoundCamera key={device.endpoint ?? device.services[0]} device={device} credentials={credentials} chosen={chosen} onChoose={onChoose} />
          ))}
        </ul>
      )}
      {found?.devices.length === 0 && <p class="quiet" role="status">{say("videos.find.none")}</p>}
      {found && found.credentials.length === 0 && <p class="quiet">{say("videos.find.noCredentials")}</p>}
      {found?.is_cut && <p class="quiet">{say("videos.find.cut")}</p>}
    </fieldset>
  );
}
