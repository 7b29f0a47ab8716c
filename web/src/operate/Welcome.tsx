// A daemon without cameras or scenes: what this is, and where to begin.

import { wayTo } from "../route";
import { say } from "../strings";

export function Welcome() {
  return (
    <div class="welcome">
      <h1>{say("welcome.title")}</h1>
      <p>{say("welcome.what")}</p>
      <ol>
        <li>{say("welcome.videos")}</li>
        <li>{say("welcome.ground")}</li>
        <li>{say("welcome.cameras")}</li>
      </ol>
      <p><a class="button is-main" href={wayTo("setup")}>{say("welcome.go")}</a></p>
    </div>
  );
}
