// Walls of screens, and the page of each screen.

import { api, content } from "../ask";
import { Shown, useAsked } from "../parts/parts";
import { say } from "../strings";

const AGAIN_MILLIS = 10_000;

async function learn() {
  const { walls } = await content(api.GET("/api/v1/walls"));
  return Promise.all(walls.map(async (wall) => {
    const told = await content(api.GET("/api/v1/walls/{id}/tiles", { params: { path: { id: wall.id } } }));
    return { ...wall, rate: told.rate_hz, screens: told.tiles };
  }));
}

export default function Walls() {
  const learnt = useAsked(learn, AGAIN_MILLIS);
  return (
    <div class="column">
      <h1>{say("wall.title")}</h1>
      <Shown learnt={learnt}>
        {(walls) => (
          <>
            <p class="quiet">{walls.length > 0 ? say("wall.help") : say("wall.none")}</p>
            {walls.map((wall) => (
              <section key={wall.id} class="card" aria-label={wall.name || wall.id}>
                <h2>{wall.name || wall.id}</h2>
                <p class="quiet">{say("wall.about", { count: wall.screens.length, scene: wall.scene, rate: wall.rate })}</p>
                <ul class="screens">
                  {wall.screens.map(({ id, size_px: [width = 0, height = 0] }) => (
                    <li key={id}>
                      <a href={`/wall?${new URLSearchParams({ wall: wall.id, tile: id }).toString()}`} target="_blank" rel="noreferrer"
                        aria-label={say("wall.tile", { tile: id, wall: wall.name || wall.id, width, height })}>
                        {id} <span class="quiet">{width} × {height}</span>
                      </a>
                    </li>
                  ))}
                </ul>
              </section>
            ))}
          </>
        )}
      </Shown>
    </div>
  );
}
