// English: Set-up's frame, its videos and its ground.

export const setup = {
  "setup.title": "Set-up",
  "setup.help": "What is set up, to read. It is changed through the interface (docs/api.md) and the configuration file.",
  "setup.scenes": "Scenes",
  "setup.scene.none": "There is no scene.",
  "setup.scene.cameras": "Cameras",
  "setup.scene.things": "What stands there",
  "setup.scene.things.text": "{ground} grounds, {boxes} boxes, {cylinders} cylinders, {footprints} footprints",
  "setup.calibrations": "Calibrations",
  "setup.calibrations.none": "No camera is calibrated.",
  "setup.uncalibrated": "not calibrated",
} as const;
