// English: walls and the page of a screen.

export const wall = {
  "wall.title": "Walls",
  "wall.none": "There is no wall yet. One is kept through the interface: PUT /api/v1/walls/ID.",
  "wall.help": "Open each screen's page on the machine that drives it, full screen. Keys there: t shows the test pattern, i which screen it is, 0 the picture.",
  "wall.tile": "Screen {tile} of {wall}, {width} × {height} pixels",
  "wall.about": "{count} screens of scene {scene}, {rate} pictures a second",

  "screen.which": "Which screen is this?",
  "screen.choose": "Choose the tile that this screen shows.",
  "screen.noWall": "There is no wall yet.",
  "screen.connecting": "Connecting ...",
  "screen.gone": "The connection is gone.",
  "screen.unreadable": "A picture cannot be read.",
  "screen.refused": "This screen is not let in: {detail}",
  "screen.login": "Log in at / on this machine, or give this screen a token; then it goes on.",
  "screen.loginFirst": "Log in at / first.",
  "screen.old": "{seconds} s old.",
  "screen.title": "{tile} of {wall}",
} as const;
