// Asks for name and password where the daemon has users; without a log-in there is nothing behind it.

import { useEffect, useRef, useState } from "preact/hooks";
import { told } from "./ask";
import { logIn } from "./session";
import { say } from "./strings";

export function LogIn() {
  const dialog = useRef<HTMLDialogElement>(null);
  const [refusal, setRefusal] = useState<string | null>(null);
  const [isAsking, setAsking] = useState(false);
  useEffect(() => dialog.current?.showModal(), []);
  const submit = async (event: SubmitEvent) => {
    event.preventDefault();
    const form = event.currentTarget as HTMLFormElement;
    const given = new FormData(form);
    const text = (name: string) => {
      const value = given.get(name);
      return typeof value === "string" ? value : "";
    };
    setRefusal(null);
    setAsking(true);
    try {
      await logIn(text("user"), text("password"));
    } catch (error) {
      setRefusal(told(error));
      setAsking(false);
      form.querySelector<HTMLInputElement>("[name=password]")?.select();
    }
  };
  return (
    <dialog ref={dialog} id="log-in" aria-labelledby="log-in-title" onCancel={(event) => event.preventDefault()}>
      <form onSubmit={(event) => void submit(event)}>
        <h1 id="log-in-title">{say("login.title")}</h1>
        <label>{say("login.user")} <input name="user" autocomplete="username" autocapitalize="none" spellcheck={false} required /></label>
        <label>{say("login.password")} <input name="password" type="password" autocomplete="current-password" required /></label>
        {refusal !== null && <p role="alert" class="trouble">{refusal}</p>}
        <button type="submit" class="is-main" disabled={isAsking}>{say("login.go")}</button>
      </form>
    </dialog>
  );
}
