// Who looks.

import { signal } from "@preact/signals";
import { Trouble, send, setCsrfToken, whenStranger } from "./ask";
import type { components } from "./contract.gen";
import { say } from "./strings";

const SESSION = "/api/v1/session";

export type Role = components["schemas"]["Role"];
type Session = { user: string | null; role: Role | null; csrf_token: string | null; name_ending: string | null };

/** Who it is; undefined until the daemon has said it. `role` is null of a stranger. */
export const session = signal<Session | undefined>(undefined);

/** What names end with that this user gives; empty where they may be any. */
export const nameEnding = () => session.value?.name_ending ?? "";

async function asked(method: string, body?: object): Promise<Session | null> {
  const init: RequestInit = { method };
  if (body) init.body = JSON.stringify(body);
  const proof = session.value?.csrf_token;
  if (proof && method !== "GET") init.headers = { "X-CSRF-Token": proof };
  const response = await send(SESSION, init);
  if (response.status === 204) return null;
  const answer = (await response.json().catch(() => ({}))) as Session & { detail?: string };
  if (!response.ok) {
    throw new Trouble(answer.detail ?? say("trouble.status", { status: response.status }), response.status);
  }
  return answer;
}

/** Resolves once it is known who looks. */
export async function learnWho(): Promise<void> {
  whenStranger(() => {
    if (session.value) session.value = { ...session.value, role: null };
  });
  for (;;) {
    try {
      const who = await asked("GET");
      if (who) {
        setCsrfToken(who.csrf_token);
        session.value = who;
        return;
      }
    } catch {
      // The bar at the top says so meanwhile.
    }
    await new Promise((resolve) => setTimeout(resolve, 2_000));
  }
}

/** Logs in; everything is asked for anew then, as this user may see it. Throws `Trouble`. */
export async function logIn(user: string, password: string): Promise<void> {
  await asked("POST", { user, password });
  location.reload();
}

/** Logs out, whatever the daemon says to it. */
export async function logOut(): Promise<void> {
  await asked("DELETE").catch(() => null);
  location.reload();
}
