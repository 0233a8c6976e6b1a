// A record: its tree, camera, plan and values at any moment of the run.

import { button, el, panel, put, svg, tell } from "./dom.js";
import { found, paint } from "./camera.js";
import { Lines, Variables } from "./panels.js";
import { day, ending, plain, reality, seconds } from "./words.js";
import "./plan.js";
import "./tree.js";

const STEP = 0.1; // seconds of the slider
const WIDE = 1000; // units of the time line

/** Return what a lane of [t, status, reason] says at t, as a tree shows it. */
function at(lane, t) {
  let [low, high] = [0, lane.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (lane[middle][0] <= t) low = middle + 1;
    else high = middle;
  }
  if (!low) return ["idle", "", null];
  const [since, status, reason] = lane[low - 1];
  return [status, reason, since];
}

export class Record {
  #link;
  #name;
  #record = null;
  #t = 0;
  #asked = null;
  #busy = false;
  #playing = 0;
  #slider = el("input", { type: "range", min: "0", step: String(STEP), value: "0", "aria-label": "Time" });
  #clock = el("output", { class: "clock" });
  #play = button("Play", () => this.#run());
  #marks = svg("svg", { class: "marks", viewBox: `0 0 ${WIDE} 12`, preserveAspectRatio: "none", "aria-hidden": "true" });
  #tree = el("studio-tree");
  #canvas = el("canvas", { width: 640, height: 480, role: "img", "aria-label": "Camera" });
  #seen = el("p", { class: "caption" });
  #plan = el("studio-plan");
  #variables = new Variables();
  #log = new Lines("Log");

  constructor(link, name) {
    this.#link = link;
    this.#name = name;
    this.node = el("article", { class: "record" }, el("p", { class: "empty" }, "It is being read…"));
    this.#slider.addEventListener("input", () => this.go(Number(this.#slider.value)));
    this.#log.node.addEventListener("click", (event) => {
      const line = event.target.closest("li[data-t]");
      if (line) this.go(Number(line.dataset.t));
    });
    this.#open();
  }

  /** Go to a moment: t seconds from the start of the run. */
  go(t) {
    const { until, lanes } = this.#record;
    this.#t = Math.max(0, Math.min(until, t));
    this.#slider.value = this.#t;
    this.#slider.setAttribute("aria-valuetext", seconds(this.#t));
    put(this.#clock, `${seconds(this.#t)} of ${seconds(until)}`);
    const statuses = {};
    for (const [key, lane] of Object.entries(lanes)) statuses[key] = at(lane, this.#t);
    this.#tree.show(statuses, this.#t, true);
    let last = null;
    for (const line of this.#log.node.children) {
      const past = Number(line.dataset.t) <= this.#t;
      line.classList.toggle("past", past);
      if (past) last = line;
    }
    if (last) this.#log.node.scrollTop = last.offsetTop - this.#log.node.clientHeight / 2;
    this.#ask();
  }

  /** Play no more. */
  end() {
    cancelAnimationFrame(this.#playing);
    this.#playing = 0;
    put(this.#play, "Play");
  }

  async #open() {
    let record;
    try {
      record = await this.#pieces();
    } catch (error) {
      this.node.replaceChildren(el("p", { class: "empty" }, error.message, error.hint && ` Try: ${error.hint}`));
      return;
    }
    this.#record = record;
    this.#slider.max = String(Math.ceil(record.until / STEP) * STEP); // a whole number of steps: the end can be reached
    for (const t of record.failures) this.#mark(t, "failed");
    const failures = record.failures.length;
    const skip = (back) => button(back ? "‹ Failure" : "Failure ›", () => this.#skip(back), {
      disabled: !failures,
      "aria-label": back ? "Previous failure" : "Next failure",
    });
    const told = `${failures || "no"} ${failures === 1 ? "failure" : "failures"}`;
    const facts = [plain(record.robot), reality(record.simulated), plain(record.world ?? ""), day(record.began), told];
    const name = this.#link.welcome?.role === "operator" && encodeURIComponent(this.#name);
    this.node.replaceChildren(
      el("h2", null, plain(record.mission)),
      el("p", { class: "facts" }, facts.filter(Boolean).join(" · ")),
      el("p", { class: `result ${record.result}` }, ending(record.result, record.reason)),
      el("div", { class: "timeline" }, this.#marks, this.#slider,
        el("div", { class: "controls" }, this.#play, skip(true), skip(false), this.#clock,
          name && el("a", { class: "button", href: `reports/${name}`, target: "_blank", rel: "noopener" }, "Report"),
          name && el("a", { class: "button", href: `records/${name}`, download: true }, "Download"))),
      el("div", { class: "columns" },
        el("div", null, panel("Tree", "tree", this.#tree)),
        el("div", null, panel("Camera", "camera", this.#canvas, this.#seen), panel("Plan", "plan", this.#plan)),
        el("div", null, panel("Variables", "values", this.#variables.node), panel("Log", "log", this.#log.node))));
    this.#tree.draw(record.drawing);
    if (record.world) this.#plan.under(this.#link, record.world);
    this.#log.add(record.log);
    this.go(record.result === "success" ? record.until : (record.failures.at(-1) ?? record.until));
  }

  /** A long record comes in pieces. */
  async #pieces() {
    const ask = (more) => this.#link.ask({ do: "record", name: this.#name, ...more });
    const record = await ask();
    for (let more = record.more; more !== undefined && more !== null; ) {
      const piece = await ask({ start: more });
      for (const name of ["log", "failures", "trail", "pictures"]) record[name] = record[name].concat(piece[name] ?? []);
      for (const [key, lane] of Object.entries(piece.lanes ?? {})) record.lanes[key] = (record.lanes[key] ?? []).concat(lane);
      more = piece.more;
    }
    return record;
  }

  #mark(t, kind) {
    const x = (t / Math.max(this.#record.until, STEP)) * WIDE;
    this.#marks.append(svg("rect", { x: x - 2, y: 0, width: 4, height: 12, class: kind }));
  }

  #skip(back) {
    const { failures } = this.#record;
    const next = back ? failures.filter((t) => t < this.#t - STEP / 2).at(-1) : failures.find((t) => t > this.#t + STEP / 2);
    if (next === undefined) tell(back ? "No failure before this moment." : "No failure after this moment.", "good");
    else this.go(next);
  }

  #run() {
    if (this.#playing) {
      this.end();
      return;
    }
    if (this.#t >= this.#record.until) this.go(0);
    put(this.#play, "Pause");
    let last = performance.now();
    const on = (now) => {
      this.go(this.#t + (now - last) / 1000);
      last = now;
      if (this.#t >= this.#record.until || !this.node.isConnected) this.end();
      else this.#playing = requestAnimationFrame(on);
    };
    this.#playing = requestAnimationFrame(on);
  }

  /** Ask for the moment that is shown: one question at a time, the newest of those that wait. */
  async #ask() {
    this.#asked = this.#t;
    if (this.#busy) return;
    this.#busy = true;
    while (this.#asked !== null) {
      const t = this.#asked;
      this.#asked = null;
      try {
        await this.#show(await this.#link.ask({ do: "moment", name: this.#name, t }));
      } catch (error) {
        tell(error);
        break;
      }
    }
    this.#busy = false;
  }

  async #show(moment) {
    this.#variables.show(moment.variables, moment.t);
    const way = this.#record.trail.filter(([t]) => t <= moment.t).map(([, x, y]) => [x, y]);
    this.#plan.show({ pose: moment.pose, percept: moment.percept ?? {} });
    this.#plan.way(way);
    this.#canvas.hidden = !moment.picture;
    put(this.#seen, moment.picture ? found(moment.picture) : "no picture of this moment");
    if (moment.picture) await paint(this.#canvas, moment.picture);
  }
}
