// A record: tree, camera, plan and values at any moment of the run.

import { button, el, panel, put, svg, notify } from "./dom.js";
import { found, paint } from "./camera.js";
import { Joints, Lines, Parts, Variables } from "./panels.js";
import { day, result_text, plain, simulation_text, seconds } from "./words.js";
import "./plan.js";
import "./tree.js";

const STEP = 0.1; // seconds between two positions of the slider
const TIMELINE_UNITS = 1000; // width of the timeline in units
const MAX_TRAIL_POINTS = 8000;

/** Return [status, reason, since] at time t from a lane of [t, status, reason]. */
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
  gone = false; // whether the record was closed
  follower = null; // the record beside it that shows the same time
  leader = null;
  #link;
  #name;
  #record = null;
  #t = 0;
  #end = 0;
  #requested_time = null;
  #is_busy = false;
  #playing = 0;
  #slider = el("input", { type: "range", min: "0", step: String(STEP), value: "0", "aria-label": "Time" });
  #clock = el("output", { class: "clock" });
  #failure_text = el("span");
  #play = button("Play", () => this.#toggle_play());
  #marks = svg("svg", { class: "marks", viewBox: `0 0 ${TIMELINE_UNITS} 12`, preserveAspectRatio: "none", "aria-hidden": "true" });
  #tree = el("studio-tree");
  #canvas = el("canvas", { width: 640, height: 480, role: "img", "aria-label": "Camera" });
  #caption = el("p", { class: "caption" });
  #plan = el("studio-plan");
  #variables = new Variables(this.#tree);
  #parts = new Parts();
  #joints = new Joints();
  #log = new Lines("Log");

  constructor(link, name) {
    this.#link = link;
    this.#name = name;
    this.#joints.panel = panel("Joints", "arm", this.#joints.node);
    this.node = el("article", { class: "record" }, el("p", { class: "empty" }, "Loading…"));
    this.#slider.addEventListener("input", () => this.go(Number(this.#slider.value)));
    this.#log.node.addEventListener("click", (event) => {
      const line = event.target.closest("li[data-t]");
      if (line) (this.leader ?? this).go(Number(line.dataset.t));
    });
    this.opened = this.#open();
  }

  get until() {
    return this.#record?.until ?? 0;
  }

  /** Let another record (or none) follow this one's time; the timeline is as long as the longer record. */
  async lead(other) {
    this.led = other;
    this.leader = null;
    if (other) other.leader = this;
    await Promise.all([this.opened, other?.opened]);
    if (this.led !== other || !this.#record) return;
    this.#end = Math.max(this.until, other?.until ?? 0);
    for (const each of [this, other]) each?.#stretch(this.#end);
    this.go(this.#t);
  }

  /** Set the length of the timeline, rounded up to a whole number of steps so that its end can be reached. */
  #stretch(until) {
    this.#slider.max = String(Math.ceil(until / STEP) * STEP);
    this.#marks.setAttribute("viewBox", `0 0 ${(TIMELINE_UNITS * until) / Math.max(this.until, STEP)} 12`);
  }

  /** Show the moment t seconds after the start of the run. */
  go(t) {
    const until = this.leader ? t : this.#end;
    this.#t = Math.max(0, Math.min(until, t));
    if (this.led?.until) this.led.go(this.#t);
    this.#slider.value = this.#t;
    this.#slider.setAttribute("aria-valuetext", seconds(this.#t));
    put(this.#clock, `${seconds(this.#t)} of ${seconds(this.until)}`);
    if (this.#record.more === undefined) this.#show_statuses(this.#t);
    let last = null;
    for (const line of this.#log.node.children) {
      const past = Number(line.dataset.t) <= this.#t;
      line.classList.toggle("past", past);
      if (past) last = line;
    }
    if (last) this.#log.node.scrollTop = last.offsetTop - this.#log.node.clientHeight / 2;
    this.#request_moment();
  }

  /** Show the statuses at time t from the loaded pieces; `changed` overrides them. */
  #show_statuses(t, changed) {
    const statuses = {};
    for (const [key, lane] of Object.entries(this.#record.lanes)) statuses[key] = at(lane, t);
    this.#tree.show({ ...statuses, ...changed }, t, true);
  }

  /** Stop playing. */
  end() {
    cancelAnimationFrame(this.#playing);
    this.#playing = 0;
    put(this.#play, "Play");
  }

  async #open() {
    let record;
    try {
      record = await this.#piece();
    } catch (error) {
      this.node.replaceChildren(el("p", { class: "empty" }, error.message, error.hint && `\nTry: ${error.hint}`));
      return;
    }
    this.#record = record;
    this.#stretch((this.#end = record.until));
    const skip = (back) => button(back ? "‹ Failed node" : "Failed node ›", () => this.#skip(back), { "aria-label": back ? "Previous failed node" : "Next failed node" });
    const facts = [plain(record.robot), simulation_text(record.simulated), plain(record.world ?? ""), day(record.began)];
    const links = record.links; // only for operators
    this.node.replaceChildren(
      el("h2", null, plain(record.mission)),
      el("p", { class: "facts" }, facts.filter(Boolean).join(" · "), " · ", this.#failure_text),
      el("p", { class: `result ${record.result}` }, result_text(record.result, record.reason)),
      el("div", { class: "timeline" }, this.#marks, this.#slider,
        el("div", { class: "controls" }, this.#play, skip(true), skip(false), this.#clock,
          links && el("a", { class: "button", href: links.report, target: "_blank", rel: "noopener" }, "Report"),
          links && el("a", { class: "button", href: links.download, download: true }, "Download"))),
      el("div", { class: "columns" },
        el("div", null, panel("Tree", "tree", this.#tree)),
        el("div", null, panel("Camera", "camera", this.#canvas, this.#caption), panel("Map", "plan", this.#plan)),
        el("div", null, panel("Variables", "values", this.#variables.node), panel("Robot", "robot", this.#parts.node), this.#joints.panel, panel("Log", "log", this.#log.node))));
    this.#tree.draw(record.drawing);
    if (record.world) this.#plan.under(this.#link, record.world);
    this.#add(record);
    this.go(record.result === "success" || record.more !== undefined ? record.until : (record.failures.at(-1) ?? record.until));
    this.#read_rest(record);
  }

  #piece(more) {
    return this.#link.ask({ do: "record", name: this.#name, ...more });
  }

  /** Read the remaining pieces of a long record while the beginning and the end are shown. */
  async #read_rest(record) {
    try {
      while (record.more !== undefined && !this.gone) {
        const piece = await this.#piece({ start: record.more });
        record.more = piece.more;
        for (const name of ["failures", "trail"]) record[name].push(...piece[name]);
        for (const [key, lane] of Object.entries(piece.lanes)) (record.lanes[key] ??= []).push(...lane);
        while (record.trail.length > MAX_TRAIL_POINTS) record.trail = record.trail.filter((_, at) => at % 2 === 0);
        this.#add(piece);
        if (record.more === undefined) this.go(this.#t);
      }
    } catch (error) {
      notify(error);
    }
  }

  /** Add the failures and log lines of a piece. */
  #add(piece) {
    for (const t of piece.failures) this.#mark(t, "failed");
    const { failures, more, result } = this.#record;
    const failed = `${failures.length || "no"} ${failures.length === 1 ? "node" : "nodes"} failed`;
    put(this.#failure_text, `${failed}${result === "success" && failures.length ? ", and the mission went on" : ""}${more === undefined ? "" : ` up to ${seconds(more)}: loading…`}`);
    this.#log.add(piece.log);
  }

  #mark(t, kind) {
    const x = (t / Math.max(this.#record.until, STEP)) * TIMELINE_UNITS;
    this.#marks.append(svg("rect", { x: x - 2, y: 0, width: 4, height: 12, class: kind }));
  }

  #skip(back) {
    const { failures } = this.#record;
    const next = back ? failures.filter((t) => t < this.#t - STEP / 2).at(-1) : failures.find((t) => t > this.#t + STEP / 2);
    if (next === undefined) notify(`No node failed ${back ? "before" : "after"} this moment.`, "good");
    else this.go(next);
  }

  #toggle_play() {
    if (this.#playing) {
      this.end();
      return;
    }
    if (this.#t >= this.#end) this.go(0);
    put(this.#play, "Pause");
    let last = performance.now();
    const on = (now) => {
      this.go(this.#t + (now - last) / 1000);
      last = now;
      if (this.#t >= this.#end || !this.node.isConnected) this.end();
      else this.#playing = requestAnimationFrame(on);
    };
    this.#playing = requestAnimationFrame(on);
  }

  /** Request the shown moment: one request at a time, then the newest waiting one. */
  async #request_moment() {
    this.#requested_time = this.#t;
    if (this.#is_busy) return;
    this.#is_busy = true;
    while (this.#requested_time !== null) {
      const t = this.#requested_time;
      this.#requested_time = null;
      try {
        await this.#show(await this.#link.ask({ do: "moment", name: this.#name, t }));
      } catch (error) {
        notify(error);
        break;
      }
    }
    this.#is_busy = false;
  }

  async #show(moment) {
    if (this.#record.more !== undefined) this.#show_statuses(moment.t, moment.changed);
    this.#tree.values(moment.variables, true);
    this.#variables.show(moment.variables, moment.t);
    const way = this.#record.trail.filter(([t]) => t <= moment.t).map(([, x, y]) => [x, y]);
    if (!moment.parts.length) this.#parts.clear();
    if (!Object.keys(moment.joints).length) this.#joints.clear();
    this.#parts.show(moment.parts);
    this.#joints.show(moment.joints);
    this.#plan.show({ pose: moment.pose, percept: moment.percept ?? {}, scan: moment.scan });
    this.#plan.way(way);
    this.#canvas.hidden = !moment.picture;
    put(this.#caption, moment.picture ? found(moment.picture) : "no picture at this moment");
    if (moment.picture) await paint(this.#canvas, moment.picture);
  }
}
