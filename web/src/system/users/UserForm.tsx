// A user who is made or changed: role, rights of cameras, password.

import { useId, useState } from "preact/hooks";
import { ask, change, told } from "../../ask";
import type { components } from "../../contract.gen";
import type { Role } from "../../session";
import * as state from "../../operate/state";
import { say, sayWord } from "../../strings";
import { nameOf } from "../Part";
import { ALL, RIGHTS, type Rights, cellOf, rowsOf, withRight } from "./rights";

export type User = components["schemas"]["User"];

const ROLES = ["viewer", "operator", "admin"] as const satisfies readonly Role[];
const LEAST_PASSWORD = 12;
export const pathOf = (id: string) => `/api/v1/users/${encodeURIComponent(id)}`;
/** A tag as conditions take it, without the mark of a compressed answer. */
const plain = (tag: string | null) => tag?.replace(/-gzip"$/, '"') ?? "";

/** The version of a user that a change names; an answer to GET says it. */
export async function tagOf(id: string): Promise<string> {
  return plain((await ask(pathOf(id))).headers.get("ETag"));
}

function Matrix({ rights, onChange }: { rights: Rights; onChange: (rights: Rights) => void }) {
  const cameras = (state.cameras.value ?? []).map(({ id }) => id);
  const title = (camera: string) => (camera === ALL ? say("system.rights.all") : nameOf(camera));
  return (
    // eslint-disable-next-line jsx-a11y/no-noninteractive-tabindex -- what scrolls must be reachable by keys
    <div class="table" role="region" aria-label={say("system.rights")} tabIndex={0}>
      <table class="matrix">
        <caption class="quiet">{say("system.rights.help")}</caption>
        <thead>
          <tr>
            <th scope="col">{say("column.camera")}</th>
            {RIGHTS.map((right) => <th key={right} scope="col" title={sayWord("system.right", right)}>{right}</th>)}
          </tr>
        </thead>
        <tbody>
          {rowsOf(rights, cameras).map((camera) => (
            <tr key={camera}>
              <th scope="row">{title(camera)}</th>
              {RIGHTS.map((right) => {
                const cell = cellOf(rights, camera, right);
                return (
                  <td key={right}>
                    <input type="checkbox" checked={cell !== "none"} disabled={cell === "all"}
                      aria-label={say("system.right.of", { right, camera: title(camera) })}
                      onChange={(event) => onChange(withRight(rights, camera, right, event.currentTarget.checked))} />
                  </td>
                );
              })}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}

/** `user` null makes a new one; `isFirst` is whether there is none yet. */
export function UserForm({ user, isFirst, onDone, onCancel }: { user: User | null; isFirst: boolean; onDone: (text: string) => void; onCancel: () => void }) {
  const ids = { name: useId(), role: useId(), password: useId() };
  const [id, setId] = useState(user?.id ?? "");
  const [role, setRole] = useState<Role>(user?.role ?? (isFirst ? "admin" : "viewer"));
  const [rights, setRights] = useState<Rights>(user?.cameras ?? {});
  const [password, setPassword] = useState("");
  const [trouble, setTrouble] = useState("");
  const [isBusy, setBusy] = useState(false);
  const isShort = password !== "" && password.length < LEAST_PASSWORD;
  const save = async () => {
    setBusy(true);
    try {
      setTrouble("");
      // The version that was shown: where somebody else changed it meanwhile that is told, and nothing is overwritten.
      const tag = user ? `"${user.version}"` : null;
      await change("PUT", pathOf(id), { role, cameras: rights, ...(password ? { password } : {}) }, { tag });
      if (isFirst) location.reload();
      onDone(say(user ? "system.user.changed" : "system.user.made", { id }));
    } catch (error) {
      setTrouble(told(error));
    }
    setBusy(false);
  };
  return (
    <form class="user-form" aria-label={user ? say("system.user.of", { id: user.id }) : say("system.user.new")} onSubmit={(event) => {
      event.preventDefault();
      void save();
    }}>
      <h3>{user ? say("system.user.of", { id: user.id }) : say("system.user.new")}</h3>
      {isFirst && <p class="quiet">{say("system.user.first")}</p>}
      {!user && (
        <div class="entry">
          <label for={ids.name}>{say("system.user.name")}</label>
          <input id={ids.name} type="text" value={id} required autocomplete="off" pattern="[a-z0-9][a-z0-9_\-]{0,63}" title={say("wall.fault.id")} onInput={(event) => setId(event.currentTarget.value)} />
        </div>
      )}
      <div class="entry">
        <label for={ids.role}>{say("system.user.role")}</label>
        <select id={ids.role} value={role} onChange={(event) => setRole(ROLES.find((known) => known === event.currentTarget.value) ?? "viewer")}>
          {ROLES.map((word) => <option key={word} value={word}>{say(`system.role.${word}`)}</option>)}
        </select>
      </div>
      <div class="entry">
        <label for={ids.password}>{say(user?.has_password ? "system.user.newPassword" : "system.user.password")}</label>
        <input id={ids.password} type="password" value={password} required={isFirst} autocomplete="new-password" aria-invalid={isShort} aria-describedby={`${ids.password}-help`}
          onInput={(event) => setPassword(event.currentTarget.value)} />
        <p class={isShort ? "wrong" : "quiet"} id={`${ids.password}-help`}>{say(user?.has_password ? "system.user.password.keep" : "system.user.password.help")}</p>
      </div>
      {role === "admin" ? <p class="quiet">{say("system.rights.admin")}</p> : <Matrix rights={rights} onChange={setRights} />}
      {trouble && <p class="wrong" role="alert">{trouble}</p>}
      <div class="choices">
        <button type="submit" class="is-main" disabled={isBusy || isShort || id === ""}>{say(user ? "system.user.save" : "system.user.make")}</button>
        <button type="button" onClick={onCancel}>{say("system.user.cancel")}</button>
      </div>
    </form>
  );
}
