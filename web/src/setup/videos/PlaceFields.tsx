// Where a camera's pictures come from: a file, an address or a device.

import { useState } from "preact/hooks";
import { Segments } from "../../parts/parts";
import { say } from "../../strings";
import { type DraftCamera, type Source, edit, editCamera, settle } from "../draft";
import { TextField } from "../Fields";
import { atCamera } from "../faults";
import { nameFrom } from "../ids";
import { without } from "../without";
import { CameraFinder, type ChosenStream } from "./CameraFinder";
import { KINDS, emptySource, kindOf, withName, withStream } from "./edits";
import { FilePicker, useSourceFiles } from "./FilePicker";

type Given = {
  camera: DraftCamera;
  isKept: boolean;
  /** What is wrong with the place, by the daemon's word. */
  fault: string | undefined;
  /** Asks for a picture of what is written now. */
  onLook: () => void;
  /** Follows the camera to another id. */
  onId: (id: string) => void;
};

function shownName({ id, name }: DraftCamera): string {
  return name || id;
}

function setSource(camera: DraftCamera, change: (source: Source) => Source, mergeKey?: string): void {
  editCamera(camera.id, say("step.place", { name: shownName(camera) }), (of) => ({ ...of, source: change(of.source) }), mergeKey);
}

function FileFields({ camera, isKept, fault, onLook, onId }: Given) {
  const path = camera.source.path ?? "";
  const [isOpen, setOpen] = useState(path === "");
  const choose = (next: string) => {
    let id = camera.id;
    edit(say("step.place", { name: shownName(camera) }), (of) => {
      // What part of the file before was played says nothing of this one.
      const source = without(camera.source, "from_secs", "until_secs");
      const cameras = of.cameras.map((one) => (one.id === camera.id ? { ...one, source: { ...source, path: next } } : one));
      const named = camera.name === "" ? withName({ ...of, cameras }, camera.id, nameFrom(next), isKept) : { draft: { ...of, cameras }, id: camera.id };
      id = named.id;
      return named.draft;
    });
    onId(id);
    onLook();
  };
  return (
    <>
      <TextField label={say("videos.path")} value={path} fault={fault} hint={path === "" ? say("videos.path.hint") : undefined}
        onInput={(value) => setSource(camera, (of) => ({ ...of, path: value.trim() }), `path ${camera.id}`)} onSettle={onLook} />
      {isOpen
        ? <FilePicker chosen={path} onChoose={choose} />
        : <p><button type="button" onClick={() => setOpen(true)}>{say("videos.files.change")}</button></p>}
    </>
  );
}

function UrlFields({ camera, isKept, fault, onLook, onId }: Given) {
  const { url = "", transport, credentials = "" } = camera.source;
  const [isOpen, setOpen] = useState(url === "");
  const take = (stream: ChosenStream) => {
    let { id } = camera;
    edit(say("step.place", { name: shownName(camera) }), (of) => {
      const taken = withStream(of, camera.id, stream, isKept);
      id = taken.id;
      return taken.draft;
    });
    onId(id);
    onLook();
  };
  return (
    <>
      <TextField label={say("videos.url")} value={url} fault={fault} placeholder="rtsp://192.168.1.20/stream1"
        hint={say(isKept && url.endsWith("…") ? "videos.url.hidden" : "videos.url.hint")}
        onInput={(value) => setSource(camera, (of) => ({ ...of, url: value.trim() }), `url ${camera.id}`)} onSettle={onLook} />
      <div class="row">
        <button type="button" disabled={url === ""} onClick={onLook}>{say("videos.url.look")}</button>
        {url.startsWith("rtsp") && (
          <Segments name="transport" label={say("videos.transport")} values={["tcp", "udp"]} chosen={transport ?? "tcp"}
            text={(value) => say(`videos.transport.${value}`)} onChoose={(value) => setSource(camera, (of) => ({ ...of, transport: value }))} />
        )}
      </div>
      <TextField label={say("videos.credentials")} value={credentials} hint={say("videos.credentials.hint")} fault={atCamera(camera.id, "source/credentials")}
        maxLength={64} onSettle={onLook}
        onInput={(value) => setSource(camera, (of) => (value.trim() === "" ? without(of, "credentials") : { ...of, credentials: value.trim() }), `credentials ${camera.id}`)} />
      {isOpen
        ? <CameraFinder chosen={url} onChoose={take} />
        : <p><button type="button" onClick={() => setOpen(true)}>{say("videos.find")}</button></p>}
    </>
  );
}

function DeviceFields({ camera, fault, onLook }: Given) {
  const { told } = useSourceFiles();
  const { device = "" } = camera.source;
  const choose = (value: string) => {
    setSource(camera, (of) => ({ ...of, device: value }));
    onLook();
  };
  return (
    <>
      <TextField label={say("videos.device")} value={device} fault={fault} hint={say("videos.device.hint")} placeholder="/dev/video0"
        onInput={(value) => setSource(camera, (of) => ({ ...of, device: value.trim() }), `device ${camera.id}`)} onSettle={onLook} />
      <div class="row">
        {told?.devices.map(({ path }) => (
          <button key={path} type="button" class={path === device ? "is-on" : ""} onClick={() => choose(path)}>{path}</button>
        ))}
        {told?.devices.length === 0 && <p class="quiet">{say("videos.device.none")}</p>}
      </div>
    </>
  );
}

const FIELDS = { path: FileFields, url: UrlFields, device: DeviceFields };

export function PlaceFields(given: Given) {
  const { camera } = given;
  const kind = kindOf(camera.source);
  const Fields = FIELDS[kind];
  return (
    <>
      <Segments name="source-kind" label={say("videos.kind")} values={KINDS} chosen={kind} text={(value) => say(`videos.add.${value}`)}
        onChoose={(value) => {
          settle();
          editCamera(camera.id, say("step.kind", { name: shownName(camera) }), (of) => ({ ...of, source: emptySource(value) }));
        }} />
      <Fields key={kind} {...given} />
    </>
  );
}
