// Puts the page together: scenes and switches above, the fused view and the cameras below.

import { ask } from "/ask.js";
import * as cameras from "/cameras.js";
import { known } from "/login.js";
import * as view from "/view.js";

const choice = document.querySelector("#scene");
const trouble = document.querySelector("#trouble");
const troubles = new Map();
let scenes = [];

const scene = () => scenes.find(({ id }) => id === choice.value) ?? null;

/** Shows what goes wrong in any part, once; nothing when all is well. */
function reporter(part) {
  return (error) => {
    if (error) troubles.set(part, error.message);
    else troubles.delete(part);
    const text = [...new Set(troubles.values())].join(" ");
    trouble.hidden = text === "";
    if (trouble.textContent !== text) trouble.textContent = text;
  };
}

async function loadScenes() {
  const report = reporter("scenes");
  for (;;) {
    try {
      scenes = (await (await ask("/api/v1/scenes")).json()).scenes;
      report(scenes.length > 0 ? null : new Error("The daemon has no scene."));
      return;
    } catch (error) {
      report(error);
      await new Promise((resolve) => setTimeout(resolve, 2000));
    }
  }
}

function showScene() {
  const shown = scene();
  if (!shown) return;
  document.title = `${shown.name} · videofields`;
  document.querySelector("#fused-title").textContent = shown.name;
  view.showScene(shown);
}

/** Calls `then` with the value of a group of radio buttons, now and at every change. */
function follow(group, then) {
  const element = document.querySelector(group);
  const tell = () => then(element.querySelector("input:checked").value);
  element.addEventListener("change", tell);
  tell();
}

follow("#entities", view.showEntities);
follow("#kind", cameras.showKind);
document.querySelector("#reset").addEventListener("click", view.resetView);
choice.addEventListener("change", showScene);
await known();
cameras.run(scene, view.mark, reporter("cameras"));
await loadScenes();
choice.replaceChildren(...scenes.map(({ id, name }) => new Option(name, id)));
document.querySelector("#scene-choice").hidden = scenes.length < 2;
showScene();
view.run(reporter("view"));
