// Texts that people read, by key; with values put in where a text has a name in braces.

import { en } from "./en";

export type Key = keyof typeof en;

/** The text of a key. */
export function say(key: Key, values: Record<string, string | number> = {}): string {
  return en[key].replace(/\{(\w+)\}/g, (whole, name: string) => String(values[name] ?? whole));
}

/** The text of a key that is made of a word of the interface (`state.live`); the word itself where there is none. */
export function sayWord(group: string, word: string): string {
  const key = `${group}.${word}`;
  return key in en ? en[key as Key] : word;
}
