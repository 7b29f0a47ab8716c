// Light or dark: as the system has it, or as the viewer chose.

import { signal } from "@preact/signals";

export const THEMES = ["system", "light", "dark"] as const;
export type Theme = (typeof THEMES)[number];
const KEPT = "videofields.theme";

function kept(): Theme {
  // Storage may be refused.
  try {
    return THEMES.find((theme) => theme === localStorage.getItem(KEPT)) ?? "system";
  } catch {
    return "system";
  }
}

export const theme = signal<Theme>(kept());

/** Shows the page in these colours from now on. */
export function chooseTheme(next: Theme): void {
  theme.value = next;
  applyTheme();
  try {
    localStorage.setItem(KEPT, next);
  } catch {
    // Then it holds until the page is left.
  }
}

/** Tells the style sheet. */
export function applyTheme(): void {
  const chosen = theme.value;
  if (chosen === "system") delete document.documentElement.dataset["theme"];
  else document.documentElement.dataset["theme"] = chosen;
}
