// New links: who came by the former ones is shut out.

import { button, el, panel, put, notify } from "./dom.js";
import { store_proof } from "./link.js";

const SECOND_PRESS_TIME = 4000; // milliseconds for the second press

/** Return the panel by which an operator makes both links anew; `stop` has a connection of its own. */
export function links(link, stop) {
  const found = el("div", { role: "status" });
  let armed = 0;
  const press = button("New links", async () => {
    clearTimeout(armed);
    if (press.textContent === "New links") {
      put(press, "Sign out everyone else?");
      armed = setTimeout(() => put(press, "New links"), SECOND_PRESS_TIME);
      return;
    }
    put(press, "New links");
    try {
      const { operator, viewer } = await link.ask({ do: "revoke" });
      store_proof((await fetch(`/?token=${operator}`, { cache: "no-store" })).url); // and this page has its new cookie
      stop.retry(); // its connection was shut out, and may have been refused since
      const row = (title, token) => el("p", null, `${title}: `, el("code", null, `${location.origin}/?token=${token}`));
      found.replaceChildren(row("For operators", operator), row("For viewers, who watch and stop", viewer));
    } catch (error) {
      notify(error);
    }
  });
  const about = el("p", { class: "hint" }, "The old links stop working. Everyone who used them is signed out, and what they drive stops.");
  return panel("Permissions", "who", about, press, found);
}
