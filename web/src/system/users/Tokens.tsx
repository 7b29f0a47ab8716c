// Tokens: what programs and screens show in a user's place. A new one is told this once.

import { useState } from "preact/hooks";
import { api, change, content, told } from "../../ask";
import { Copied } from "../../parts/Copied";
import { Table, useAsked } from "../../parts/parts";
import { Sure } from "../../parts/Sure";
import { session } from "../../session";
import { say } from "../../strings";
import { Part, SELDOM_MILLIS, when } from "../Part";

/** The end of a day as people mean it, on this machine's clock. */
const endOf = (day: string) => new Date(`${day}T23:59:59`).toISOString();

export function Tokens({ users }: { users: readonly string[] }) {
  const [round, setRound] = useState(0);
  const learnt = useAsked(async () => (await content(api.GET("/api/v1/tokens"))).tokens, SELDOM_MILLIS, String(round));
  const [user, setUser] = useState("");
  const [note, setNote] = useState("");
  const [day, setDay] = useState("");
  const [secret, setSecret] = useState<string | null>(null);
  const [trouble, setTrouble] = useState("");
  const attempt = async (deed: () => Promise<void>) => {
    try {
      setTrouble("");
      await deed();
      setRound(round + 1);
    } catch (error) {
      setTrouble(told(error));
    }
  };
  const make = () => attempt(async () => {
    const body = { note, ...(user ? { user } : {}), ...(day ? { expires_at: endOf(day) } : {}) };
    const { token } = await change<{ token: string }>("POST", "/api/v1/tokens", body);
    setSecret(token);
    setNote("");
  });
  return (
    <Part title="system.tokens" learnt={learnt}>
      {(tokens) => (
        <>
          {users.length > 0 && (
            <form class="choices filters" aria-label={say("system.token.new")} onSubmit={(event) => {
              event.preventDefault();
              void make();
            }}>
              <label class="inline">{say("column.user")}{" "}
                <select value={user} onChange={(event) => setUser(event.currentTarget.value)}>
                  <option value="">{session.value?.user ?? ""}</option>
                  {users.filter((id) => id !== session.value?.user).map((id) => <option key={id} value={id}>{id}</option>)}
                </select>
              </label>
              <label class="inline">{say("column.note")} <input type="text" value={note} maxLength={200} onInput={(event) => setNote(event.currentTarget.value)} /></label>
              <label class="inline">{say("column.expires")} <input type="date" value={day} onInput={(event) => setDay(event.currentTarget.value)} /></label>
              <button type="submit">{say("system.token.make")}</button>
            </form>
          )}
          {secret !== null && <Copied label={say("system.token")} text={secret} note={say("system.token.once")} onClose={() => setSecret(null)} />}
          {trouble && <p class="wrong" role="alert">{trouble}</p>}
          <Table caption={say("system.tokens")} none={say("system.tokens.none")} columns={["column.user", "column.note", "column.made", "column.expires", "column.do"]}
            rows={tokens.map(({ id, user: of, note: what, created_at, expires_at }) => [
              of, what, when(created_at), expires_at === null ? say("answer.forever") : when(expires_at),
              <Sure key="revoke" text={say("system.token.revoke")} label={say("system.token.revoke.of", { user: of, note: what })} question={say("system.token.revoke.sure")}
                onSure={() => void attempt(() => change("DELETE", `/api/v1/tokens/${encodeURIComponent(id)}`))} />,
            ])} />
        </>
      )}
    </Part>
  );
}
