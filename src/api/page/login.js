// Who looks: asks for name and password where the daemon has users, and logs out again.

const SESSION = "/api/v1/session";
const dialog = document.querySelector("#log-in");
const form = dialog.querySelector("form");
const refusal = dialog.querySelector("[role=alert]");
const leave = document.querySelector("#log-out");

async function asked(method, body) {
  const response = await fetch(SESSION, { method, body: body && JSON.stringify(body), cache: "no-store" });
  if (response.status === 204) return null;
  const answer = await response.json();
  if (!response.ok) throw new Error(answer.detail ?? `The daemon answered ${response.status}.`);
  return answer;
}

function refuse(error) {
  refusal.textContent = error ? error.message : "";
  refusal.hidden = !error;
}

form.addEventListener("submit", async (event) => {
  event.preventDefault();
  refuse(null);
  const { user, password } = Object.fromEntries(new FormData(form));
  const button = form.querySelector("button");
  button.disabled = true;
  try {
    await asked("POST", { user, password });
    // Everything anew, as this user may see it.
    location.reload();
  } catch (error) {
    refuse(error);
    button.disabled = false;
    form.elements.password.select();
  }
});
// Without a log-in there is nothing behind it.
dialog.addEventListener("cancel", (event) => event.preventDefault());
leave.addEventListener("click", async () => {
  await asked("DELETE").catch(() => null);
  location.reload();
});
document.addEventListener("stranger", () => {
  if (!dialog.open) dialog.showModal();
});

/** Resolves once it is known who looks; never for a stranger, who gets the log-in instead. */
export async function known() {
  for (;;) {
    try {
      const { user, role } = await asked("GET");
      leave.hidden = user === null;
      leave.textContent = `Log out ${user ?? ""}`;
      if (role !== null) return;
      dialog.showModal();
      await new Promise(() => {});
    } catch {
      await new Promise((resolve) => setTimeout(resolve, 2000));
    }
  }
}
