// Questions to the daemon, and what goes wrong with them as one kind of error whose message a person can read. Whatever answers
// or stays silent is told to `connection.ts`.

import createClient, { type Middleware } from "openapi-fetch";
import type { paths } from "./contract.gen";
import { answered, silent } from "./connection";
import { say } from "./strings";

const PATIENCE_MILLIS = 15_000;

/** A place in what was sent that is wrong: a JSON pointer or a parameter, and what is allowed there. */
export type PlacedFault = { readonly pointer?: string; readonly parameter?: string; readonly detail: string };

/** What the daemon refused, or that it did not answer (status 0). */
export class Trouble extends Error {
  constructor(
    message: string,
    readonly status: number,
    readonly faults: readonly PlacedFault[] = [],
  ) {
    super(message);
  }
}

/** What is told of an error. */
export function told(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

let csrfToken: string | null = null;
let onStranger = () => {};

/** What a change proves that it comes from this page with. */
export function setCsrfToken(token: string | null): void {
  csrfToken = token;
}

/** Calls `then` whenever the daemon says that it does not know who asks. */
export function whenStranger(then: () => void): void {
  onStranger = then;
}

/** As `fetch`, with an end to patience; throws `Trouble` for silence, and nothing where `signal` ended it. */
export async function send(input: Request | string, init: RequestInit = {}, patienceMillis = PATIENCE_MILLIS): Promise<Response> {
  const patience = AbortSignal.timeout(patienceMillis);
  const signal = init.signal ? AbortSignal.any([init.signal, patience]) : patience;
  try {
    const response = await fetch(input, { cache: "no-store", ...init, signal });
    answered();
    return response;
  } catch (error) {
    if (init.signal?.aborted) throw error;
    silent();
    throw new Trouble(say("trouble.silent"), 0);
  }
}

async function refused(response: Response): Promise<never> {
  if (response.status === 401) onStranger();
  const problem = (await response.json().catch(() => null)) as { detail?: string; errors?: PlacedFault[] } | null;
  const message = problem?.detail ?? say("trouble.status", { status: response.status });
  throw new Trouble(message, response.status, problem?.errors);
}

const proof: Middleware = {
  onRequest({ request }) {
    if (csrfToken !== null && request.method !== "GET") request.headers.set("X-CSRF-Token", csrfToken);
    return request;
  },
};

/** The daemon's interface as its contract has it. */
export const api = createClient<paths>({ fetch: (request) => send(request) });
api.use(proof);

/** What an answer of `api` holds; throws `Trouble` where it was refused. */
export async function content<Data>(asked: Promise<{ data?: Data; response: Response; error?: unknown }>): Promise<Data> {
  const { data, error, response } = await asked;
  if (response.ok && data !== undefined) return data;
  if (response.status === 401) onStranger();
  const problem = error as { detail?: string; errors?: PlacedFault[] } | undefined;
  throw new Trouble(problem?.detail ?? say("trouble.status", { status: response.status }), response.status, problem?.errors);
}

export type Parameters = Record<string, string | number | null | undefined>;

/** A path with those parameters that have a value. */
export function address(path: string, parameters: Parameters = {}): string {
  const query = new URLSearchParams();
  for (const [name, value] of Object.entries(parameters)) {
    if (value !== null && value !== undefined) query.set(name, String(value));
  }
  const text = query.toString();
  return text ? `${path}?${text}` : path;
}

/** The answer to GET; what the caller has already (`tag`) comes as 304. Throws `Trouble`. */
export async function ask(
  path: string,
  parameters: Parameters = {},
  { signal, tag }: { signal?: AbortSignal; tag?: string | null } = {},
): Promise<Response> {
  const init: RequestInit = tag ? { headers: { "If-None-Match": tag } } : {};
  if (signal) init.signal = signal;
  const response = await send(address(path, parameters), init);
  return response.ok || response.status === 304 ? response : refused(response);
}

/** Changes something, or asks with a body: JSON, text or a file. `tag`: the version that is changed, null where there must be none
 * yet. Answers what the daemon said, as JSON unless `raw`. Throws `Trouble`. */
export async function change<Answer = unknown>(
  method: string,
  path: string,
  body?: unknown,
  given: { tag?: string | null; type?: string; raw?: boolean; signal?: AbortSignal; headers?: Record<string, string>; patienceMillis?: number } = {},
): Promise<Answer> {
  const headers = new Headers(given.headers);
  if (csrfToken !== null && method !== "GET") headers.set("X-CSRF-Token", csrfToken);
  if (given.tag === null) headers.set("If-None-Match", "*");
  else if (given.tag !== undefined) headers.set("If-Match", given.tag);
  const init: RequestInit = { method, headers };
  if (given.signal) init.signal = given.signal;
  if (typeof body === "string" || body instanceof Blob) {
    init.body = body;
    if (given.type) headers.set("Content-Type", given.type);
  } else if (body !== undefined) {
    init.body = JSON.stringify(body);
    headers.set("Content-Type", "application/json");
  }
  const response = await send(path, init, given.patienceMillis);
  if (!response.ok) return refused(response);
  if (given.raw) return response as Answer;
  const text = await response.text();
  return (text === "" ? undefined : JSON.parse(text)) as Answer;
}
