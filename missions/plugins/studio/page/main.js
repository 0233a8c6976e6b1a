// The page: its views, the shown run, and the status of the connection.

import { el, put, notify } from "./dom.js";
import { Drive, MAX_STATE_AGE } from "./drive.js";
import { Failsafe } from "./failsafe.js";
import { Fleet } from "./fleet.js";
import { Link } from "./link.js";
import { Live } from "./live.js";
import { Records } from "./records.js";
import { Robot } from "./robot.js";
import { Run } from "./run.js";
import { Tasks } from "./tasks.js";
import { Watcher } from "./watch.js";
import { plain, simulation_text, seconds } from "./words.js";
import "./stop.js";

const VIEWS = { run: Run, live: Live, drive: Drive, robot: Robot, records: Records, tasks: Tasks, fleet: Fleet, failsafe: Failsafe };

const link = new Link();
const watcher = new Watcher(link);
const stop = document.querySelector("studio-stop");
const view = document.getElementById("view");
const runSelect = document.getElementById("which");
const linkOutput = document.getElementById("link");
const views = {};
let currentView = null;

stop.begin(link, watcher);

function show() {
  const [name, ...rest] = location.hash.slice(1).split("/");
  const word = name in VIEWS ? name : "run";
  for (const each of document.querySelectorAll("nav a")) {
    if (each.hash === `#${word}`) each.setAttribute("aria-current", "page");
    else each.removeAttribute("aria-current");
  }
  const next = (views[word] ??= new VIEWS[word]({ link, watcher, stop }));
  if (next !== currentView) {
    currentView?.hide();
    currentView = next;
    view.replaceChildren(next.node);
    scrollTo(0, 0);
  }
  if (link.welcome) next.show(...rest.map(decodeName));
}

/** Decode a part of the address; a typed address may contain a plain "%". */
function decodeName(part) {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

function runs() {
  const there = watcher.runs;
  const options = there.map((each) => [each.run, `${plain(each.mission)}, ${plain(each.robot)}, ${simulation_text(each.simulated)}`]);
  if (watcher.run && !watcher.entry) options.unshift([watcher.run, `${plain(watcher.scene?.mission ?? watcher.run)} (ended)`]);
  if (!options.length) options.push(["", "no runs"]);
  runSelect.replaceChildren(...options.map(([value, text]) => el("option", { value }, text)));
  runSelect.value = watcher.run;
}

function showLink() {
  const age = link.age;
  const slow = link.open && (age > 2500 || link.roundTrip > MAX_STATE_AGE);
  const how = age > 2500 ? `no message for ${seconds(age / 1000)}` : `slow connection: round trip ${seconds(link.roundTrip / 1000)}`;
  const words = {
    connecting: "connecting…",
    open: slow ? how : `${link.welcome?.role}${link.welcome?.role === "viewer" ? ": you can watch and stop" : ""}`,
    lost: `connection lost ${Number.isFinite(age) ? `${seconds(Math.round(age / 1000))} ago` : ""}, reconnecting`,
    refused: "not signed in: open the link that mission studio printed",
    old: "this page is out of date: reload it",
  };
  put(linkOutput, words[link.how]);
  linkOutput.className = `link ${slow ? "lost" : link.how}`;
  document.body.classList.toggle("is-lost", !link.open);
}

link.on("welcome", () => currentView && view.contains(currentView.node) && showLink());
link.on("how", (how) => {
  showLink();
  if (how === "open") show();
  if (how === "old") {
    notify("The studio now serves another version of this page.");
    document.getElementById("notes").lastChild.prepend(el("button", { type: "button", class: "main", onclick: () => location.reload() }, "Reload"));
  }
});
// Errors without a pending command are about driving; the page already shows these.
link.on("trouble", (error) => ["no_such_run", "stopped", "no_wheels", "stale", "let_go"].includes(error.error) || notify(error));
watcher.addEventListener("runs", runs);
watcher.addEventListener("which", runs);
watcher.addEventListener("scene", runs);
watcher.addEventListener("over", runs);
runSelect.addEventListener("change", () => watcher.follow(runSelect.value));
addEventListener("hashchange", show);
setInterval(showLink, 1000);
show();
runs();
