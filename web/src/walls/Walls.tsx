// Walls of screens: all of them, and one that is set up.

import "../parts/forms.css";
import "./walls.css";
import { useEffect, useState } from "preact/hooks";
import { api, content, told } from "../ask";
import * as state from "../operate/state";
import { Shown, useAsked } from "../parts/parts";
import { print, route } from "../route";
import { say } from "../strings";
import { newWall } from "./document";
import * as editor from "./draft";
import { PatternsOf } from "./Screens";
import { screenPath } from "./screens";
import { ownView } from "./ShowFields";
import { WallEditor } from "./WallEditor";

const AGAIN_MILLIS = 10_000;

async function learn() {
  const { walls } = await content(api.GET("/api/v1/walls"));
  editor.takenIds.value = walls.map(({ id }) => id);
  return Promise.all(walls.map(async (wall) => {
    const told = await content(api.GET("/api/v1/walls/{id}/tiles", { params: { path: { id: wall.id } } }));
    return { ...wall, rate: told.rate_hz, screens: told.tiles };
  }));
}

function List() {
  const learnt = useAsked(learn, AGAIN_MILLIS);
  return (
    <>
      <div class="choices">
        <h1>{say("wall.title")}</h1>
        {editor.mayChange.value && <a class="button" href={print({ place: "wall", details: { new: "1" } })}>{say("wall.add")}</a>}
      </div>
      <Shown learnt={learnt}>
        {(walls) => (
          <>
            <p class="quiet">{walls.length > 0 ? say("wall.help") : say(editor.mayChange.value ? "wall.none.add" : "wall.none")}</p>
            {walls.map((wall) => (
              <section key={wall.id} class="card" aria-label={wall.name || wall.id}>
                <h2><a href={print({ place: "wall", details: { wall: wall.id } })}>{wall.name || wall.id}</a></h2>
                <p class="quiet">{say("wall.about", { count: wall.screens.length, scene: wall.scene, rate: wall.rate })}</p>
                <PatternsOf wall={wall.id} />
                <ul class="screens">
                  {wall.screens.map(({ id, size_px: [width = 0, height = 0] }) => (
                    <li key={id}>
                      <a href={screenPath(wall.id, id)} target="_blank" rel="noreferrer"
                        aria-label={say("wall.tile", { tile: id, wall: wall.name || wall.id, width, height })}>
                        {id}
                      </a>
                      <span class="quiet">{width} × {height}</span>
                    </li>
                  ))}
                </ul>
              </section>
            ))}
          </>
        )}
      </Shown>
    </>
  );
}

/** Opens what the address names, once it is known what there is. */
function One({ id }: { id: string | null }) {
  const [trouble, setTrouble] = useState("");
  const scene = state.scene.value?.id;
  const isReady = id !== null || scene !== undefined;
  useEffect(() => {
    let isGone = false;
    const begin = async () => {
      try {
        setTrouble("");
        if (id !== null) await editor.open(id);
        else if (scene !== undefined) {
          const view = await ownView(scene).catch(() => null);
          if (!isGone) editor.openNew(newWall(scene, view));
        }
      } catch (error) {
        setTrouble(told(error));
      }
    };
    if (isReady) void begin();
    return () => {
      isGone = true;
    };
  }, [id, isReady]);
  useEffect(() => editor.close, []);
  if (editor.draft.value) return <WallEditor />;
  return (
    <>
      <h1>{id ?? say("wall.new")}</h1>
      {trouble ? (
        <p class="trouble" role="alert">{trouble} <a href={print({ place: "wall", details: {} })}>{say("wall.back")}</a></p>
      ) : <p class="quiet">{say("place.loading")} …</p>}
    </>
  );
}

export default function Walls() {
  const { wall, new: isNew } = route.value.details;
  return (
    <div class="column walls">
      {wall !== undefined || isNew !== undefined ? <One id={wall ?? null} /> : <List />}
    </div>
  );
}
