// The page: its views by their addresses, the run that is shown, and how the link is.

import { el, put, tell } from "./dom.js";
import { Drive, OLDEST } from "./drive.js";
import { Failsafe } from "./failsafe.js";
import { Fleet } from "./fleet.js";
import { Link } from "./link.js";
import { Live } from "./live.js";
import { Records } from "./records.js";
import { Robot } from "./robot.js";
import { Run } from "./run.js";
import { Tasks } from "./tasks.js";
import { Watcher } from "./watch.js";
import { plain, reality, seconds } from "./words.js";
import "./stop.js";

const VIEWS = { run: Run, live: Live, drive: Drive, robot: Robot, records: Records, tasks: Tasks, fleet: Fleet, failsafe: Failsafe };

const link = new Link();
const watcher = new Watcher(link);
const stop = document.querySelector("studio-stop");
const view = document.getElementById("view");
const which = document.getElementById("which");
const said = document.getElementById("link");
const made = {};
let shown = null;

stop.begin(link, watcher);

function show() {
  const [name, ...rest] = location.hash.slice(1).split("/");
  const word = name in VIEWS ? name : "run";
  for (const each of document.querySelectorAll("nav a")) {
    if (each.hash === `#${word}`) each.setAttribute("aria-current", "page");
    else each.removeAttribute("aria-current");
  }
  const next = (made[word] ??= new VIEWS[word]({ link, watcher, stop }));
  if (next !== shown) {
    shown?.hide();
    shown = next;
    view.replaceChildren(next.node);
    scrollTo(0, 0);
  }
  if (link.welcome) next.show(...rest.map(named));
}

/** Return the name in a part of the address; what somebody has typed may have a "%" of its own. */
function named(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

function runs() {
  const there = watcher.runs;
  const options = there.map((each) => [each.run, `${plain(each.mission)}, ${plain(each.robot)}, ${reality(each.simulated)}`]);
  if (watcher.run && !watcher.entry) options.unshift([watcher.run, `${plain(watcher.scene?.mission ?? watcher.run)} (ended)`]);
  if (!options.length) options.push(["", "no runs"]);
  which.replaceChildren(...options.map(([value, text]) => el("option", { value }, text)));
  which.value = watcher.run;
}

function told() {
  const age = link.age;
  const slow = link.open && (age > 2500 || link.roundTrip > OLDEST);
  const how = age > 2500 ? `no message for ${seconds(age / 1000)}` : `slow connection: round trip ${seconds(link.roundTrip / 1000)}`;
  const words = {
    connecting: "connecting…",
    open: slow ? how : `${link.welcome?.role}${link.welcome?.role === "viewer" ? ": you can watch and stop" : ""}`,
    lost: `connection lost ${Number.isFinite(age) ? `${seconds(Math.round(age / 1000))} ago` : ""}, reconnecting`,
    refused: "not signed in: open the link that mission studio printed",
    old: "this page is out of date: reload it",
  };
  put(said, words[link.how]);
  said.className = `link ${slow ? "lost" : link.how}`;
  document.body.classList.toggle("is-lost", !link.open);
}

link.on("welcome", () => shown && view.contains(shown.node) && told());
link.on("how", (how) => {
  told();
  if (how === "open") show();
  if (how === "old") {
    tell("The studio now serves another version of this page.");
    document.getElementById("notes").lastChild.prepend(el("button", { type: "button", class: "main", onclick: () => location.reload() }, "Reload"));
  }
});
// What is answered without having been asked is about driving: that the run has ended, is stopped, or is driven by
// somebody else, or that commands come too late, the page shows anyway.
link.on("trouble", (error) => ["no_such_run", "stopped", "no_wheels", "stale", "let_go"].includes(error.error) || tell(error));
watcher.addEventListener("runs", runs);
watcher.addEventListener("which", runs);
watcher.addEventListener("scene", runs);
watcher.addEventListener("over", runs);
which.addEventListener("change", () => watcher.follow(which.value));
addEventListener("hashchange", show);
setInterval(told, 1000);
show();
runs();
