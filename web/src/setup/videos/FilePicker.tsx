// Files that the daemon finds in the folders it may read, to search and choose from.

import { useEffect, useState } from "preact/hooks";
import { told } from "../../ask";
import { say } from "../../strings";
import { bytes, clock } from "../../units";
import { type SourceFiles, sourceFiles } from "../requests";

const MOST_SHOWN = 200;

/** What is at the daemon's machine, asked once for every time this is opened or `again` is called. */
export function useSourceFiles(): { told: SourceFiles | null; failure: string | null; again: () => void } {
  const [round, setRound] = useState(0);
  const [answer, setAnswer] = useState<{ told: SourceFiles | null; failure: string | null }>({ told: null, failure: null });
  useEffect(() => {
    let isShown = true;
    sourceFiles().then(
      (files) => isShown && setAnswer({ told: files, failure: null }),
      (error: unknown) => isShown && setAnswer({ told: null, failure: told(error) }),
    );
    return () => {
      isShown = false;
    };
  }, [round]);
  return { ...answer, again: () => setRound(round + 1) };
}

export function FilePicker({ chosen, onChoose }: { chosen: string; onChoose: (path: string) => void }) {
  const { told, failure, again } = useSourceFiles();
  const [text, setText] = useState("");
  if (failure !== null) return <p class="quiet">{say("videos.files.failed", { message: failure })} <button type="button" onClick={again}>{say("videos.files.again")}</button></p>;
  if (!told) return <p class="quiet">{say("place.loading")} …</p>;
  const words = text.toLowerCase().split(/\s+/).filter(Boolean);
  const fits = told.files.filter(({ path }) => words.every((word) => path.toLowerCase().includes(word)));
  return (
    <fieldset class="files">
      <legend>{say("videos.files")}</legend>
      <div class="row">
        <input type="search" aria-label={say("videos.files.search")} placeholder={say("videos.files.search")} value={text}
          onInput={(event) => setText(event.currentTarget.value)} />
        <button type="button" onClick={again}>{say("videos.files.again")}</button>
      </div>
      <div class="files-list">
        {fits.slice(0, MOST_SHOWN).map(({ path, bytes: size, modified_at, count }) => {
          const cut = path.lastIndexOf("/") + 1;
          return (
            <label key={path} class="file">
              <input type="radio" name="source-file" value={path} checked={path === chosen} onChange={() => onChoose(path)} />
              <span class="file-path"><span class="quiet">{path.slice(0, cut)}</span><strong>{path.slice(cut)}</strong></span>
              <span class="quiet">{count === undefined ? bytes(size) : say("videos.files.count", { count })} · {clock(Date.parse(modified_at)).slice(0, 16)}</span>
            </label>
          );
        })}
        {told.files.length === 0 && <p class="quiet">{say("videos.files.none")}</p>}
        {told.files.length > 0 && fits.length === 0 && <p class="quiet">{say("videos.files.noMatch", { text })}</p>}
      </div>
      {(told.is_cut || fits.length > MOST_SHOWN) && <p class="quiet">{say("videos.files.cut")}</p>}
    </fieldset>
  );
}
