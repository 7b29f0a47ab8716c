// English: scenes drawn in the browser, and headsets.

export const spatial = {
  "spatial.none": "This browser draws no 3D here (WebGL 2 is missing or switched off). The daemon's pictures need none.",
  "spatial.lost": "The graphics card took the picture away. It is drawn again as soon as the browser gives it back.",
} as const;
