// A picture that is brought from a file: shown small, kept with the draft.

import { useRef, useState } from "preact/hooks";
import { told } from "../../ask";
import { say } from "../../strings";
import { keepFile } from "../assets";
import { useUrl } from "../ground/GroundPicture";
import { fileFault } from "./ModelButton";

export const PICTURE_ENDINGS = ".png,.jpg,.jpeg";
const MOST_PIXELS = 8192;

/** Keeps a picture, and answers what the document names it and its size; throws what is wrong with it, in words. */
async function bring(file: File): Promise<{ path: string; size: [number, number] }> {
  const fault = fileFault(file, PICTURE_ENDINGS);
  if (fault !== null) throw new Error(fault);
  const picture = await createImageBitmap(file).catch(() => null);
  if (!picture) throw new Error(say("geometry.file.unread"));
  const size: [number, number] = [picture.width, picture.height];
  picture.close();
  if (Math.max(...size) > MOST_PIXELS) throw new Error(say("geometry.file.pixels", { most: MOST_PIXELS }));
  return { path: await keepFile(file), size };
}

export function PictureField({ label, file, onPicture, onRemove, fault }: {
  label: string;
  file: string | undefined;
  onPicture: (path: string, size: [number, number]) => void;
  onRemove?: () => void;
  fault?: string | undefined;
}) {
  const input = useRef<HTMLInputElement>(null);
  const [failure, setFailure] = useState<string | null>(null);
  const { url, isMissing } = useUrl(file);
  const take = async (of: File) => {
    try {
      const { path, size } = await bring(of);
      setFailure(null);
      onPicture(path, size);
    } catch (error) {
      setFailure(told(error));
    }
  };
  return (
    <div class="geo-picture">
      <span>{label}</span>
      <div class="row">
        {url !== null && <img src={url} alt={say("geometry.picture.alt", { label })} />}
        {isMissing && <span class="quiet">{file}</span>}
        <button type="button" aria-label={`${label}: ${say(file === undefined ? "geometry.picture.choose" : "geometry.picture.other")}`} onClick={() => input.current?.click()}>
          {say(file === undefined ? "geometry.picture.choose" : "geometry.picture.other")}
        </button>
        {file !== undefined && onRemove && (
          <button type="button" aria-label={`${label}: ${say("geometry.picture.remove")}`} onClick={onRemove}>{say("geometry.picture.remove")}</button>
        )}
      </div>
      <input ref={input} type="file" accept={PICTURE_ENDINGS} hidden aria-label={label}
        onChange={(event) => {
          const [of] = event.currentTarget.files ?? [];
          if (of) void take(of);
          event.currentTarget.value = "";
        }} />
      <span class="fault" role="status">{failure ?? fault}</span>
    </div>
  );
}
