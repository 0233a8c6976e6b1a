// Live: the present state of a run.

import { button, el, panel, put, on_frame, notify, toggle } from "./dom.js";
import { Joints, Lines, Parts, Variables } from "./panels.js";
import { result_text, plain, simulation_text, seconds } from "./words.js";
import "./camera.js";
import "./plan.js";
import "./tree.js";

const MAX_AGE = 1500; // milliseconds without an update after which the view is greyed

export class Live {
  #link;
  #watcher;
  #is_shown = false;
  #title = el("h1");
  #facts = el("p", { class: "facts" });
  #result = el("p", { class: "result", role: "status" });
  #clock = el("span", { class: "clock" });
  #age = el("p", { class: "age", role: "status" });
  #tree = el("studio-tree", { class: "live" });
  #ticks = el("span", { class: "hint" });
  #last_delay = 0; // seconds by which the last late tick was late
  #camera = el("studio-camera");
  #plan = el("studio-plan");
  #variables = new Variables(this.#tree);
  #parts = new Parts();
  #joints = new Joints();
  #speech = new Lines("Speech", ["said", "heard"]);
  #log = new Lines("Log");
  #pause = button("Pause", () => this.#do(this.#watcher.state?.paused ? "resume" : "pause"));
  #step = button("Step", () => this.#do("step"));
  #halt = button("End the mission", () => this.#end_mission(), { class: "danger" });
  #pending = new Map();
  #show_tables_soon = on_frame(() => this.#show_tables(), 200);

  constructor({ link, watcher }) {
    this.#link = link;
    this.#watcher = watcher;
    const follow = toggle("Follow the running node", true, (on) => (this.#tree.follow = on));
    this.#tree.follow = true;
    const tools = el("div", { class: "tools" }, follow, button("Fold all", () => this.#tree.fold(true)), button("Unfold all", () => this.#tree.fold(false)), this.#ticks);
    const cameras = panel("Camera", "camera", this.#camera);
    cameras.addEventListener("fold", () => (this.#camera.shown = this.#is_shown && !cameras.classList.contains("folded")));
    this.#joints.panel = panel("Joints", "arm", this.#joints.node);
    this.node = el("div", { class: "view live" },
      el("div", { class: "head" }, el("div", null, this.#title, this.#facts, this.#result, this.#age),
        el("div", { class: "controls", role: "group", "aria-label": "The mission" }, this.#clock, this.#pause, this.#step, this.#halt)),
      el("div", { class: "actions begin" }, el("a", { class: "button", href: "#run" }, "Choose a mission"), el("a", { class: "button", href: "#drive" }, "Drive without a mission")),
      el("div", { class: "columns" },
        el("div", null, panel("Tree", "tree", tools, this.#tree), panel("Variables", "values", this.#variables.node)),
        el("div", null, cameras, panel("Map", "plan", this.#plan), panel("Speech", "spoken", this.#speech.node)),
        el("div", null, panel("Robot", "robot", this.#parts.node), this.#joints.panel, panel("Log", "log", this.#log.node))));
    this.#camera.begin(watcher);
    watcher.addEventListener("which", () => this.#clear());
    watcher.addEventListener("scene", ({ detail }) => this.#show_scene(detail));
    watcher.addEventListener("state", ({ detail }) => this.#show_state(detail));
    watcher.addEventListener("over", () => this.#show_controls());
    link.on("how", () => this.#show_controls());
    setInterval(() => this.#show_age(), 500);
    this.#clear();
    if (!watcher.scene) return;
    this.#show_scene(watcher.scene); // the run began before this view existed
    this.#show_state({ ...watcher.state, anew: true });
  }

  show() {
    this.#is_shown = true;
    this.#camera.shown = true;
    this.#show_controls();
  }

  hide() {
    this.#is_shown = false;
    this.#camera.shown = false;
  }

  #clear() {
    for (const each of [this.#variables, this.#parts, this.#joints, this.#speech, this.#log]) each.clear();
    this.#plan.clear();
    this.#tree.clear();
    this.node.classList.add("none");
    put(this.#title, this.#watcher.run ? "…" : "No run");
    put(this.#facts, this.#watcher.run ? "" : "Start a mission in Run or in a terminal to see it here.");
    put(this.#result, "");
    this.#show_controls();
  }

  #show_scene(scene) {
    this.node.classList.remove("none");
    put(this.#title, plain(scene.mission));
    const params = Object.entries(scene.params).map(([name, value]) => `${plain(name)}: ${value}`);
    put(this.#facts, [plain(scene.robot), simulation_text(scene.simulated), plain(scene.world), ...params].filter(Boolean).join(" · "));
    this.#tree.draw(scene.drawing, scene.first);
    this.#plan.under(this.#link, scene.world);
    this.#plan.way(scene.way);
    for (const each of [this.#variables, this.#speech, this.#log]) each.clear();
    for (const [name, values] of Object.entries(scene.past)) for (const [t, value] of values) this.#variables.show({ [name]: value }, t);
  }

  #show_state(state) {
    if (state.changed || state.anew) this.#tree.show(state.changed ?? {}, state.t, state.anew);
    else this.#tree.show({}, state.t);
    if (state.visited) this.#tree.visit(state.visited);
    this.#last_delay = state.late || this.#last_delay;
    this.#plan.show(state);
    this.#speech.add(state.log);
    this.#log.add(state.log, state.lost);
    if (state.variables) this.#tree.values(state.variables, state.anew);
    if (state.variables) this.#pending.set("variables", { ...this.#pending.get("variables"), ...state.variables });
    for (const name of ["parts", "joints"]) if (state[name]) this.#pending.set(name, state[name]);
    this.#show_tables_soon();
  }

  /** Update the tables, at most once in a frame. */
  #show_tables() {
    const { state } = this.#watcher;
    if (!state) return;
    put(this.#ticks, `tick ${state.tick}, ${state.lates ? `${state.lates} late, the last by ${Math.round(1000 * this.#last_delay)} ms` : "none late"}`);
    this.#variables.show(this.#pending.get("variables"), state.t);
    this.#parts.show(this.#pending.get("parts"));
    this.#joints.show(this.#pending.get("joints"));
    this.#pending.clear();
    this.#show_controls();
  }

  #show_controls() {
    const { state, over, lives } = this.#watcher;
    const may = this.#link.welcome?.role === "operator" && this.#link.open && lives;
    const stopped = Boolean(state?.stopped);
    put(this.#clock, state ? seconds(state.t) : "");
    put(this.#pause, state?.paused ? "Resume" : "Pause");
    this.#pause.disabled = !may || stopped;
    this.#step.disabled = !may || stopped || !state.paused;
    this.#halt.disabled = !may || state.stopping;
    let result = "";
    if (over) result = result_text(over.result, over.reason);
    else if (stopped) result = `■ ${state.stopped}`;
    else if (state?.stopping) result = "ending…";
    else if (state?.paused) result = "❚❚ paused";
    else if (state?.driver) result = `${state.driver} drives`;
    put(this.#result, result);
    this.#result.className = `result ${over ? over.result || "unknown" : stopped ? "failure" : ""}`;
  }

  #show_age() {
    const age = this.#watcher.lives ? performance.now() - this.#watcher.came : 0;
    const old = age > MAX_AGE || (this.#watcher.lives && !this.#link.open);
    this.node.classList.toggle("old", old);
    put(this.#age, old ? `No news for ${seconds(Math.round(age / 1000))}: the view is out of date.` : "");
  }

  async #do(word) {
    try {
      await this.#watcher.ask(word);
    } catch (error) {
      notify(error);
    }
  }

  #end_mission() {
    if (!this.#halt.classList.contains("armed")) {
      this.#halt.classList.add("armed");
      put(this.#halt, "Press again to end it");
      setTimeout(() => {
        this.#halt.classList.remove("armed");
        put(this.#halt, "End the mission");
      }, 3000);
      return;
    }
    this.#do("halt");
  }
}
