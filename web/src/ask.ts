// Questions to the daemon, and what goes wrong with them as one kind of error whose message a person can read. Whatever answers
// or stays silent is told to `connection.ts`.

import createClient, { type Middleware } from "openapi-fetch";
import type { paths } from "./contract.gen";
import { answered, silent } from "./connection";
import { say } from "./strings";

const PATIENCE_MILLIS = 15_000;

/** What the daemon refused, or that it did not answer (status 0). */
export class Trouble extends Error {
  constructor(
    message: string,
    readonly status: number,
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
export async function send(input: Request | string, init: RequestInit = {}): Promise<Response> {
  const patience = AbortSignal.timeout(PATIENCE_MILLIS);
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
  const problem = (await response.json().catch(() => null)) as { detail?: string } | null;
  const message = problem?.detail ?? say("trouble.status", { status: response.status });
  throw new Trouble(message, response.status);
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
  const detail = (error as { detail?: string } | undefined)?.detail;
  throw new Trouble(detail ?? say("trouble.status", { status: response.status }), response.status);
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
