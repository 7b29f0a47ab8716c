// Set-up, as far as it goes: which scenes there are, what stands in them and which of their cameras are calibrated.

import { api, content } from "../ask";
import { Shown, Table, useAsked } from "../parts/parts";
import { say } from "../strings";
import * as state from "../operate/state";

const AGAIN_MILLIS = 10_000;

async function learnCalibrations() {
  return (await content(api.GET("/api/v1/calibrations", { params: { query: { limit: 1000 } } }))).calibrations;
}

async function learnScenes() {
  const { scenes } = await content(api.GET("/api/v1/scenes"));
  return Promise.all(scenes.map(async (scene) => ({
    ...scene,
    document: await content(api.GET("/api/v1/scenes/{id}", { params: { path: { id: scene.id } } })),
  })));
}

function name(id: string): string {
  return state.cameras.value?.find((camera) => camera.id === id)?.name ?? id;
}

export default function Setup() {
  const scenes = useAsked(learnScenes, AGAIN_MILLIS);
  const calibrations = useAsked(learnCalibrations, AGAIN_MILLIS);
  return (
    <div class="column">
      <h1>{say("setup.title")}</h1>
      <p class="quiet">{say("setup.help")}</p>
      <section class="card">
        <h2>{say("setup.scenes")}</h2>
        <Shown learnt={scenes}>
          {(told) => (
            <Table caption={say("setup.scenes")} none={say("setup.scene.none")}
              columns={["column.scene", "setup.scene.cameras", "setup.scene.things"]}
              rows={told.map(({ id, name: title, cameras, document }) => [
                `${title} (${id})`,
                cameras.map(name).join(", "),
                say("setup.scene.things.text", {
                  ground: document.ground?.length ?? 0,
                  boxes: document.boxes?.length ?? 0,
                  cylinders: document.cylinders?.length ?? 0,
                  footprints: document.footprints?.length ?? 0,
                }),
              ])} />
          )}
        </Shown>
      </section>
      <section class="card">
        <h2>{say("setup.calibrations")}</h2>
        <Shown learnt={calibrations}>
          {(told) => {
            const bare = (state.cameras.value ?? []).filter(({ id }) => !told.some(({ camera }) => camera === id));
            return (
              <Table caption={say("setup.calibrations")} none={say("setup.calibrations.none")}
                columns={["column.camera", "column.scene", "column.size", "column.lens", "column.position"]}
                rows={[
                  ...told.map(({ camera, scene, image_size_px, lens, position_m }) => [
                    name(camera), scene, image_size_px.join(" × "), lens.replace("_", " "),
                    position_m.map((metres) => metres.toFixed(2)).join(", "),
                  ]),
                  ...bare.map(({ id }) => [name(id), say("setup.uncalibrated"), "", "", ""]),
                ]} />
            );
          }}
        </Shown>
      </section>
    </div>
  );
}
