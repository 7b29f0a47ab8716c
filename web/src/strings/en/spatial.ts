// English: scenes drawn in the browser, and headsets.

export const spatial = {
} as const;
