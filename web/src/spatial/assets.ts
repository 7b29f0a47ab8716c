// Files that scenes name, as far as browsers are given them: `assets/NAME` lies at /api/v1/assets/NAME. Others stay on the daemon's
// machine, and what needs them is shown plain.

import { ClampToEdgeWrapping, LinearFilter, LinearMipmapLinearFilter, RepeatWrapping, SRGBColorSpace, Texture } from "three";
import { served } from "./served";

const ANISOTROPY = 8;
const MOST_PIXELS = 4_096;
/** Colours as they are stored, and not multiplied by what is transparent. */
const PLAINLY: ImageBitmapOptions = { colorSpaceConversion: "none", premultiplyAlpha: "none" };

/** Where a file of a scene is served; null where it is not. */
export function assetPath(file: string): string | null {
  const name = /^assets\/([^/\\]+)$/.exec(file)?.[1];
  return name === undefined ? null : `/api/v1/assets/${encodeURIComponent(name)}`;
}

/** A texture of a picture, its rows from above, with what graphics cards need to show it from afar. */
export function textureOf(image: ImageBitmap, wraps: { repeats: boolean; turns?: boolean }): Texture {
  const texture = new Texture(image);
  texture.colorSpace = SRGBColorSpace;
  texture.flipY = false;
  texture.wrapS = wraps.repeats || wraps.turns ? RepeatWrapping : ClampToEdgeWrapping;
  texture.wrapT = wraps.repeats ? RepeatWrapping : ClampToEdgeWrapping;
  texture.minFilter = LinearMipmapLinearFilter;
  texture.magFilter = LinearFilter;
  texture.anisotropy = ANISOTROPY;
  texture.needsUpdate = true;
  return texture;
}

/** A picture, and the size that its file has: what is drawn may be smaller. */
export type Picture = { readonly image: ImageBitmap; readonly size: readonly [number, number] };

/** Pictures of a scene, each fetched once, however many surfaces show it. */
export class Pictures {
  private readonly fetched = new Map<string, Promise<Picture | null>>();
  private readonly ending = new AbortController();

  /** The picture of a file; null where it is not served or cannot be read. */
  picture(file: string): Promise<Picture | null> {
    const known = this.fetched.get(file);
    if (known) return known;
    const path = assetPath(file);
    const coming = path === null ? Promise.resolve(null) : this.fetch(path).catch(() => null);
    this.fetched.set(file, coming);
    return coming;
  }

  private async fetch(path: string): Promise<Picture> {
    const image = await createImageBitmap(await served(path, this.ending.signal), PLAINLY);
    const most = Math.max(image.width, image.height);
    const whole = [image.width, image.height] as const;
    if (most <= MOST_PIXELS) return { image, size: whole };
    const size = { resizeWidth: Math.round((image.width * MOST_PIXELS) / most), resizeHeight: Math.round((image.height * MOST_PIXELS) / most) };
    const smaller = await createImageBitmap(image, { ...PLAINLY, ...size });
    image.close();
    return { image: smaller, size: whole };
  }

  dispose(): void {
    this.ending.abort();
    for (const coming of this.fetched.values()) void coming.then((picture) => picture?.image.close());
    this.fetched.clear();
  }
}
