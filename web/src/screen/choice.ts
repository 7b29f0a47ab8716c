// The page without a tile: lists every wall's, for whoever stands before a screen to choose.

import { Trouble, api, content, told } from "../ask";
import { say } from "../strings";

function link(wall: string, tile: string): HTMLAnchorElement {
  const anchor = document.createElement("a");
  anchor.href = `/wall?${new URLSearchParams({ wall, tile }).toString()}`;
  anchor.textContent = tile;
  return anchor;
}

/** Fills the list; `enter` lets this screen in first. */
export async function choose(place: HTMLElement, enter: () => Promise<void>): Promise<void> {
  const [title, help] = [document.createElement("h1"), document.createElement("p")];
  title.textContent = say("screen.which");
  place.append(title, help);
  place.hidden = false;
  try {
    await enter();
    const { walls } = await content(api.GET("/api/v1/walls"));
    help.textContent = walls.length > 0 ? say("screen.choose") : say("screen.noWall");
    for (const { id, name } of walls) {
      const { tiles } = await content(api.GET("/api/v1/walls/{id}/tiles", { params: { path: { id } } }));
      const [heading, list] = [document.createElement("h2"), document.createElement("div")];
      heading.textContent = name || id;
      list.className = "tiles";
      list.append(...tiles.map((one) => link(id, one.id)));
      place.append(heading, list);
    }
  } catch (error) {
    const isStranger = error instanceof Trouble && error.status === 401;
    help.textContent = isStranger ? say("screen.loginFirst") : told(error);
  }
}
