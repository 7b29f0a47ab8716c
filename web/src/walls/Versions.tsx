// What a wall was before: each version can be looked at in the draft, or brought back.

import { useState } from "preact/hooks";
import { api, ask, content } from "../ask";
import { Table, useAsked } from "../parts/parts";
import { say } from "../strings";
import { clock } from "../units";
import { type WallDocument, readWall } from "./document";
import { base, edit, reason, restore } from "./draft";

const SELDOM_MILLIS = 30_000;

export function Versions({ id, onError }: { id: string; onError: (text: string) => void }) {
  const [isOpen, setOpen] = useState(false);
  return (
    <details class="card more" open={isOpen} onToggle={(event) => setOpen(event.currentTarget.open)}>
      <summary>{say("wall.versions")}</summary>
      {isOpen && <List key={base.value.tag} id={id} onError={onError} />}
    </details>
  );
}

function List({ id, onError }: { id: string; onError: (text: string) => void }) {
  const learnt = useAsked(async () => (await content(api.GET("/api/v1/walls/{id}/versions", { params: { path: { id } } }))).versions, SELDOM_MILLIS, id);
  const look = async (number: number) => {
    try {
      const response = await ask(`/api/v1/walls/${encodeURIComponent(id)}/versions/${number}`);
      const wall = readWall((await response.json()) as WallDocument);
      edit(() => wall);
    } catch (error) {
      onError(reason(error));
    }
  };
  const versions = learnt.data ?? [];
  const newest = versions[0]?.version;
  return (
    <>
      {learnt.failure !== undefined && <p class="wrong">{learnt.failure}</p>}
      <Table caption={say("wall.versions")} none={say("wall.versions.none")} columns={["wall.version", "wall.version.at", "wall.version.by", "wall.version.what"]}
        rows={versions.map(({ version, changed_at, changed_by, removed }) => [
          version, clock(Date.parse(changed_at)), changed_by ?? "",
          removed ? say("wall.version.removed") : version === newest ? say("wall.version.newest") : (
            <span key="do" class="choices">
              <button type="button" aria-label={say("wall.version.look.of", { n: version })} onClick={() => void look(version)}>{say("wall.version.look")}</button>
              <button type="button" aria-label={say("wall.version.restore.of", { n: version })}
                onClick={() => void restore(version).catch((error: unknown) => onError(reason(error)))}>{say("wall.version.restore")}</button>
            </span>
          ),
        ])} />
    </>
  );
}
