// New links, which sign out everyone who used the old ones.

import { button, el, panel, put, notify } from "./dom.js";
import { store_proof } from "./link.js";

const SECOND_PRESS_TIME = 4000; // milliseconds until the first press is forgotten

/** Return the panel with which an operator replaces both links; `stop` reconnects its own connections then. */
export function links(link, stop) {
  const found = el("div", { role: "status" });
  let armed = 0;
  const press = button("New links", async () => {
    clearTimeout(armed);
    if (press.textContent === "New links") {
      put(press, "Press again to sign out everyone else");
      armed = setTimeout(() => put(press, "New links"), SECOND_PRESS_TIME);
      return;
    }
    put(press, "New links");
    try {
      const { operator, viewer } = await link.ask({ do: "revoke" });
      store_proof((await fetch(`/?token=${operator}`, { cache: "no-store" })).url); // which gives this page its new cookie
      stop.retry(); // its connections were closed, and may have been refused since
      const row = (title, token) => el("p", null, `${title}: `, el("code", null, `${location.origin}/?token=${token}`));
      found.replaceChildren(row("For operators", operator), row("For viewers, who watch and stop", viewer));
    } catch (error) {
      notify(error);
    }
  });
  const about = el("p", { class: "hint" }, "The old links stop working. Everyone who used them is signed out, and what they drive stops.");
  return panel("Access links", "who", about, press, found);
}
