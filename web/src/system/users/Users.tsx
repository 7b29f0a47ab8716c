// Users: who there is, made, changed and removed by admins; and their tokens.

import { useState } from "preact/hooks";
import { api, change, content, told } from "../../ask";
import { Table, useAsked } from "../../parts/parts";
import { Sure } from "../../parts/Sure";
import { say } from "../../strings";
import { Part, SELDOM_MILLIS, nameOf, yes } from "../Part";
import { ALL, printed } from "./rights";
import { Tokens } from "./Tokens";
import { type User, UserForm, pathOf, tagOf } from "./UserForm";

/** The user that is being changed; null for a new one. */
type Open = { readonly user: User | null };

export default function Users() {
  const [round, setRound] = useState(0);
  const learnt = useAsked(async () => (await content(api.GET("/api/v1/users"))).users, SELDOM_MILLIS, String(round));
  const [open, setOpen] = useState<Open | null>(null);
  const [outcome, setOutcome] = useState("");
  const [trouble, setTrouble] = useState("");
  const done = (text: string) => {
    setOpen(null);
    setTrouble("");
    setOutcome(text);
    setRound(round + 1);
  };
  const remove = async (id: string) => {
    try {
      await change("DELETE", pathOf(id), undefined, { tag: await tagOf(id) });
      done(say("system.user.removed", { id }));
    } catch (error) {
      setTrouble(told(error));
    }
  };
  const rights = (user: User) => (user.role === "admin" ? say("system.rights.everything") : printed(user.cameras, (id) => (id === ALL ? say("system.rights.all") : nameOf(id))));
  return (
    <>
      <Part title="system.users" learnt={learnt}>
        {(users) => (
          <>
            <p class="quiet" role="status">{outcome}</p>
            {trouble && <p class="wrong" role="alert">{trouble}</p>}
            <Table caption={say("system.users")} none={say("system.users.none")} columns={["column.user", "column.role", "column.rights", "column.password", "column.do"]}
              rows={users.map((user) => [
                user.id, user.role, rights(user), yes(user.has_password),
                <span key="do" class="choices">
                  <button type="button" aria-label={say("system.user.change.of", { id: user.id })} onClick={() => {
                    setOutcome("");
                    setOpen({ user });
                  }}>{say("system.user.change")}</button>
                  <Sure text={say("system.user.remove")} label={say("system.user.remove.of", { id: user.id })} question={say("system.user.remove.sure", { id: user.id })} onSure={() => void remove(user.id)} />
                </span>,
              ])} />
            {open === null ? (
              <div><button type="button" class="is-main" onClick={() => setOpen({ user: null })}>{say("system.user.new")}</button></div>
            ) : <UserForm key={open.user?.id ?? ""} user={open.user} isFirst={users.length === 0} onDone={done} onCancel={() => setOpen(null)} />}
          </>
        )}
      </Part>
      <Tokens users={(learnt.data ?? []).map(({ id }) => id)} />
    </>
  );
}
