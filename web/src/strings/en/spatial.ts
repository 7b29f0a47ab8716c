// English: scenes drawn in the browser, and headsets.

export const spatial = {
  "spatial.none": "This browser draws no 3D here (WebGL 2 is missing or switched off). The daemon's pictures need none.",
  "spatial.lost": "The graphics card took the picture away. It is drawn again as soon as the browser gives it back.",

  "spatial.drawing": "Drawn by",
  "spatial.drawing.auto": "Auto",
  "spatial.drawing.server": "Daemon",
  "spatial.drawing.browser": "Browser",
  "spatial.by.browser": "Drawn by this browser,",
  "spatial.by.server": "Drawn by the daemon,",
  "spatial.why.wished": "as chosen.",
  "spatial.why.fast": "which manages {rate} pictures a second.",
  "spatial.why.measuring": "which is being timed.",
  "spatial.why.slow": "since this browser manages only {rate} pictures a second of at least {least}.",
  "spatial.why.none": "since this browser draws no 3D (WebGL 2 is missing or switched off).",
  "spatial.why.software": "since this browser has no graphics card to draw with.",
  "spatial.why.past": "since cameras tell the browser only of now.",
  "spatial.why.lost": "since this browser lost its graphics card.",
  "spatial.why.hulls": "since the browser draws no shapes.",
  "spatial.why.auto": "since the server chooses between shapes and billboards, and the browser draws no shapes.",
  "spatial.why.effects": "since the browser draws no shade, other light or dots.",
  "spatial.why.points": "since the browser draws no points.",

  "spatial.headset.enter": "Enter VR",
  "spatial.headset.enter.title": "See the scene through the headset: point and pull the trigger to go somewhere, push a stick aside to turn",
  "spatial.headset.around": "Look around",
  "spatial.headset.around.title": "Stand in the scene and look around by turning this device, or by dragging",
  "spatial.headset.leave": "Leave",
  "spatial.headset.leave.title": "Back to the view as it was",
  "spatial.headset.failed": "The headset does not begin: {message}",
} as const;
