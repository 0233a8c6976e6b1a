// State of the shown run, merged from its scene and the following states.

const EMPTY = { changed: {}, variables: {}, parts: [], joints: {}, commands: {}, log: [] };
const MAX_LOG_LINES = 500;
export const UNKNOWN = "unknown"; // in place of a run name if a run may have been missed

/** Follows one run at a time; emits "runs", "scene", "state", "picture", "over" and "which" (another run). */
export class Watcher extends EventTarget {
  runs = [];
  run = "";
  scene = null;
  state = null;
  over = null;
  picture = null; // the newest
  came = 0;
  #link;
  #camera_rates = new Map();
  #rate = 0;

  constructor(link) {
    super();
    this.#link = link;
    link.on("runs", (message) => this.#on_runs(message.runs));
    link.on("scene", (message) => message.run === this.run && this.#begin(message));
    link.on("state", (message) => message.run === this.run && this.scene && this.#update(message));
    link.on("picture", (message) => {
      if (message.run !== this.run) return;
      this.picture = message;
      this.#emit("picture", message);
    });
    link.on("over", (message) => message.run === this.run && this.#end(message));
    link.on("how", (how) => how === "open" && this.run && this.#watch());
    document.addEventListener("visibilitychange", () => this.#update_rate());
  }

  /** The entry of the run in `runs`. */
  get entry() {
    return this.runs.find((each) => each.run === this.run);
  }

  /** Whether the shown run goes on. */
  get lives() {
    return Boolean(this.scene && !this.over);
  }

  /** Show another run. */
  follow(run) {
    if (run === this.run) return;
    if (this.run && !this.over) this.#link.send({ do: "watch", run: this.run, state: false });
    this.run = run;
    this.scene = this.state = this.over = this.picture = null;
    if (run) this.#watch();
    this.#emit("which", run);
  }

  look(who, rate) {
    this.#camera_rates.set(who, rate);
    this.#update_rate();
  }

  /** Send a command to the shown run and return its result. */
  ask(word, members) {
    return this.#link.ask({ do: word, run: this.run, ...members });
  }

  send(word, members) {
    return this.#link.send({ do: word, run: this.run, ...members });
  }

  #update_rate() {
    const rate = document.hidden ? 0 : Math.max(0, ...this.#camera_rates.values());
    if (rate === this.#rate) return;
    this.#rate = rate;
    if (this.run && !this.over) this.#watch();
  }

  #watch() {
    if (!this.#link.open) return;
    const watched = this.run;
    this.ask("watch", { pictures: this.#rate }).catch((error) => {
      if (watched !== this.run || error.error === "lost") return;
      this.#end({ result: "", reason: error.message, seconds: this.state?.t ?? 0 });
    });
  }

  #on_runs(runs) {
    this.runs = runs.filter((each) => each.run !== UNKNOWN);
    const there = this.runs.some((each) => each.run === this.run);
    if (!there && (this.over || !this.run || !this.scene) && this.runs.length) this.follow(this.runs[0].run);
    this.#emit("runs", this.runs);
  }

  #begin(scene) {
    this.scene = scene;
    this.over = null;
    this.state = { ...EMPTY, ...scene.state, log: [...scene.log] };
    this.came = performance.now();
    this.#emit("scene", scene);
    this.#emit("state", { ...scene.state, log: scene.log, anew: true });
  }

  #update(message) {
    const { state } = this;
    const { changed, variables, commands, log, ...rest } = message;
    Object.assign(state, rest);
    if (changed) state.changed = { ...state.changed, ...changed };
    if (commands) state.commands = { ...state.commands, ...commands };
    if (variables) {
      state.variables = { ...state.variables, ...variables };
      for (const [name, value] of Object.entries(variables)) if (value === null) delete state.variables[name];
    }
    if (log) state.log = [...state.log, ...log].slice(-MAX_LOG_LINES);
    this.came = performance.now();
    this.#emit("state", message);
  }

  #end(message) {
    this.over = message;
    this.#emit("over", message);
  }

  #emit(type, detail) {
    this.dispatchEvent(new CustomEvent(type, { detail }));
  }
}
