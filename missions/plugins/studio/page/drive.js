// Drive: sticks, keys and a game pad. The base stops when focus, page, pointer or connection is lost.

import { button, el, field, panel, put, notify, toggle } from "./dom.js";
import { Target } from "./form.js";
import { figure, seconds } from "./words.js";
import "./camera.js";
import "./plan.js";
import "./stick.js";

const SEND_INTERVAL = 60; // milliseconds between commands
const GIVE_TIMEOUT = 1000; // milliseconds in which a run reports its driver
const ZERO_COMMANDS = 3; // zero commands sent after the last one that moves
const PROBE_INTERVAL = 500; // milliseconds between commands at rest, for the round trip
export const MAX_STATE_AGE = 500; // milliseconds; the run refuses commands that are based on an older state
const KEYS = {
  w: [1, 0, 0, 0], ArrowUp: [1, 0, 0, 0], s: [-1, 0, 0, 0], ArrowDown: [-1, 0, 0, 0],
  a: [0, 1, 0, 0], ArrowLeft: [0, 1, 0, 0], d: [0, -1, 0, 0], ArrowRight: [0, -1, 0, 0],
  j: [0, 0, 1, 0], l: [0, 0, -1, 0], k: [0, 0, 0, 1], i: [0, 0, 0, -1],
};
const DRIVE_BUTTON = 4; // the game pad button that must be held to drive
const STOP_BUTTON = 1; // the game pad button for STOP
const PAD_DEAD_ZONE = 0.12;

export class Drive {
  #link;
  #watcher;
  #stop;
  #is_shown = false;
  #keys = new Set();
  #number = 0;
  #zero_count = { drive: ZERO_COMMANDS, look: ZERO_COMMANDS };
  #is_giving = false; // control released, not confirmed by the run yet
  #held_stops = []; // indices of the game pads whose red button is held
  #is_blocked = false; // until all controls are released: a command was late, or STOP was pressed
  #is_refused = false; // by the run, since all controls were released last
  #last_sent_at = -Infinity;
  #base = el("studio-stick", { role: "group", "aria-label": "Stick of the base: drag it, or hold W A S D or the arrow keys" });
  #head = el("studio-stick", { role: "group", "aria-label": "Stick of the head: drag it, or hold I J K L" });
  #take = button("Take control", () => this.#toggle_wheels(), { class: "main" });
  #resume = button("Resume", () => this.#watcher.ask("resume").catch(notify), { hidden: true });
  #status = el("p", { class: "wheels", role: "status" });
  #request = el("div", { class: "warning", role: "alert", hidden: true });
  #delay = el("p", { class: "facts delay" });
  #refusal_box = el("div", { class: "warning slow", role: "alert", hidden: true });
  #pace = el("input", { type: "range", min: "5", max: "100", step: "5", value: "30" });
  #limit = el("output");
  #camera = el("studio-camera");
  #plan = el("studio-plan");
  #start_box = el("div", { hidden: true }); // form that starts a run for driving by hand
  #library_request = null; // promise of the library for that form
  #target = null; // its choice of robot or simulation
  #edition = "";
  #pad = el("p", { class: "hint" }, "Game pad: press a button to connect it.");

  constructor({ link, watcher, stop }) {
    this.#link = link;
    this.#watcher = watcher;
    this.#stop = stop;
    const limit = field("Speed limit", this.#pace);
    limit.append(this.#limit);
    const keys = el("p", { class: "hint" }, "Keys: W A S D or arrows drive, I J K L turn the head.");
    this.node = el("div", { class: "view drive" },
      el("div", { class: "scene" }, panel("Camera", "camera", this.#camera), panel("Map", "plan", this.#plan)),
      el("div", { class: "cockpit" },
        this.#start_box, el("div", { class: "row" }, this.#take, this.#status, this.#resume), this.#delay, this.#refusal_box, this.#request, limit,
        el("div", { class: "sticks" }, el("div", null, this.#base, el("span", null, "drive")), el("div", null, this.#head, el("span", null, "head"))),
        keys, this.#pad));
    this.#camera.begin(watcher);
    this.#listen();
    watcher.addEventListener("which", () => (this.#release_sticks(), this.#plan.clear(), this.#show_state()));
    watcher.addEventListener("scene", ({ detail }) => this.#plan.under(link, detail.world));
    watcher.addEventListener("state", ({ detail }) => {
      this.#plan.show(detail);
      this.#show_state();
      if (!this.#zero_count.drive || !this.#zero_count.look) this.#send(); // while moving, answer each new state at once with a command based on it
    });
    watcher.addEventListener("over", () => (this.#release_sticks(), this.#show_state()));
    link.on("how", () => (this.#release_sticks(), this.#show_state()));
    link.on("trouble", ({ error }) => {
      if (error !== "stale" && error !== "let_go") return;
      this.#is_refused = true;
      this.#block();
    });
    stop.addEventListener("stop", () => this.#block());
    setInterval(() => this.#send(), SEND_INTERVAL);
    this.#pace.addEventListener("input", () => this.#show_state());
    if (watcher.state) this.#plan.show(watcher.state);
    this.#show_state();
  }

  show() {
    this.#is_shown = this.#camera.shown = true;
    if (this.#watcher.scene) this.#plan.under(this.#link, this.#watcher.scene.world);
    this.#show_state();
    this.#update_library().catch(() => null); // keep the former robots and worlds
  }

  /** Update the choices of robots and worlds. */
  async #update_library() {
    if (!this.#target) return;
    const library = await this.#link.library(this.#edition);
    this.#edition = library.edition;
    if (library.missions) this.#target.update(library);
  }

  /** If there is no run, offer to start a mission that does nothing by itself, for driving by hand. */
  async #offer_start() {
    const wanted = !this.#watcher.lives && this.#link.open && this.#link.welcome?.role === "operator";
    this.#start_box.hidden = !wanted;
    if (!wanted || !this.#is_shown || this.#library_request) return;
    this.#library_request = this.#link.library();
    try {
      const library = await this.#library_request;
      const target = (this.#target = new Target(library));
      this.#edition = library.edition;
      const seeing = toggle("With head and camera", true);
      const begin = button("Drive without a mission", async () => {
        begin.disabled = true;
        try {
          const mission = `by_hand/${seeing.getAttribute("aria-checked") === "true" ? "drive_and_look" : "drive_by_hand"}`;
          const { run } = await this.#link.ask({ do: "start", mission, ...target.members() }, 60000);
          target.reset_confirmation();
          this.#watcher.follow(run);
          await this.#watcher.ask("take");
        } catch (error) {
          notify(error);
        } finally {
          begin.disabled = false;
        }
      }, { class: "main" });
      this.#start_box.replaceChildren(el("div", { class: "alone" }, target.node, seeing, el("div", { class: "actions" }, begin)));
    } catch (error) {
      this.#library_request = null; // requested again on reconnect, or when this view is shown again
      notify(error);
    }
  }

  hide() {
    this.#is_shown = this.#camera.shown = false;
    this.#give_wheels();
  }

  /** Whether this page has control. */
  get #has_wheels() {
    const { state, lives } = this.#watcher;
    return Boolean(lives && this.#link.open && state?.driver && state.driver === this.#link.welcome?.name);
  }

  #listen() {
    document.addEventListener("visibilitychange", () => document.hidden && this.#give_wheels());
    addEventListener("pagehide", () => this.#give_wheels());
    addEventListener("blur", () => this.#give_wheels());
    addEventListener("keydown", (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (!this.#is_shown || !(key in KEYS) || event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input, select, textarea, li")) return;
      event.preventDefault();
      this.#keys.add(key);
      if (!event.repeat) this.#send();
    });
    addEventListener("keyup", (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      if (this.#keys.delete(key)) this.#send();
    });
    for (const stick of [this.#base, this.#head]) stick.addEventListener("push", () => this.#push(stick));
    addEventListener("gamepaddisconnected", () => {
      put(this.#pad, "The game pad was disconnected.");
      this.#block();
    });
  }

  /** Send a released stick at once; a moved stick waits for the send interval. */
  #push(stick) {
    if (!stick.left && !stick.up) this.#send();
  }

  /** Return the shares requested by sticks, keys and game pad: base ahead and left, head left and down. */
  #setpoint() {
    const found = [this.#base.up, this.#base.left, this.#head.left, -this.#head.up];
    for (const key of this.#keys) KEYS[key].forEach((share, at) => (found[at] += share));
    this.#read_pads().forEach((share, at) => (found[at] += share));
    return found.map((share) => Math.max(-1, Math.min(1, share)) || 0);
  }

  #read_pads() {
    const all = [...(navigator.getGamepads?.() ?? [])].filter((each) => each?.connected);
    const pads = all.filter((each) => each.mapping === "standard");
    // Without the standard mapping (mode D) every button is STOP.
    const stops = (each) => (each.mapping === "standard" ? each.buttons[STOP_BUTTON]?.pressed : each.buttons.some((one) => one.pressed));
    const red = all.filter(stops).map((each) => each.index);
    const pressed = red.some((index) => !this.#held_stops.includes(index));
    this.#held_stops = red;
    if (pressed) this.#stop.stop(); // also while blocked, in another view, or on a second pad
    const pad = pads[0];
    if (!pad && all.length && this.#is_shown) {
      put(this.#pad, "Game pad: unknown layout. Every button is STOP, and the sticks do nothing; set its switch to X (XInput).");
    }
    if (!pad || !this.#is_shown) return [];
    const held = pad.buttons[DRIVE_BUTTON]?.pressed;
    put(this.#pad, held ? "Game pad: driving." : "Game pad: hold the left shoulder button to drive; the red button on the right is STOP.");
    if (!held) return [];
    const [x, y, pan, tilt] = pad.axes.map((value) => (Math.abs(value) < PAD_DEAD_ZONE ? 0 : value));
    return [-y, -x, -(pan ?? 0), tilt ?? 0];
  }

  /** Milliseconds from a state to the command based on it. */
  get #roundTrip() {
    const { state } = this.#watcher;
    return Math.max(this.#link.roundTrip, this.#has_wheels ? 1000 * state.round_trip : 0);
  }

  /** Reason why driving is refused; empty if it is not. */
  get #refusal() {
    if (!this.#watcher.lives || !this.#link.open || this.#link.welcome?.role !== "operator") return "";
    if (this.#has_wheels && performance.now() - this.#watcher.came > MAX_STATE_AGE) return "Driving is refused: no new state from the robot.";
    if (this.#roundTrip > MAX_STATE_AGE) {
      return "Driving is refused: the connection is too slow. You would see the robot too late, and it would stop too late. "
        + "Move closer to its wireless network, or switch the camera off.";
    }
    if (this.#is_blocked && this.#is_refused) return "The base was stopped. Let go of all controls, then drive again.";
    return "";
  }

  #show_delay() {
    if (!this.#is_shown) return;
    const known = this.#watcher.lives && this.#link.open;
    const delay = this.#roundTrip;
    const told = delay < 1000 ? `${Math.round(delay / 10) * 10} ms` : seconds(delay / 1000);
    put(this.#delay, known ? `Round trip: ${told} (driving needs at most ${MAX_STATE_AGE} ms)` : "");
    const refusal = this.#refusal;
    put(this.#refusal_box, refusal);
    this.#refusal_box.hidden = !refusal;
    this.node.classList.toggle("refused", Boolean(refusal));
  }

  #stamp() {
    this.#last_sent_at = performance.now();
    return { n: ++this.#number, stamp: this.#watcher.state.stamp };
  }

  #send() {
    const [ahead, left, pan, tilt] = this.#setpoint();
    const moving = ahead || left || pan || tilt;
    if (!moving) this.#is_blocked = this.#is_refused = false;
    else if (this.#has_wheels && this.#refusal) this.#is_blocked = true;
    this.#show_delay();
    if (!this.#has_wheels || !this.#is_shown || this.#is_giving || this.#watcher.state.stopped) return;
    const go = (word, members, still) => {
      this.#zero_count[word] = still ? this.#zero_count[word] + 1 : 0;
      const due = this.#zero_count[word] <= ZERO_COMMANDS || (word === "drive" && performance.now() - this.#last_sent_at > PROBE_INTERVAL);
      if (due) this.#watcher.send(word, { ...this.#stamp(), ...members });
    };
    if (this.#is_blocked) go("drive", { ahead: 0, left: 0 }, true);
    else {
      go("drive", { ahead, left, pace: this.#pace.value / 100 }, !ahead && !left);
      if (this.#watcher.scene.parts.includes("head")) go("look", { left: pan, down: tilt }, !pan && !tilt);
    }
  }

  /** Send zero commands until all controls are released. */
  #block() {
    this.#zero_count.drive = 0;
    this.#is_blocked = true;
    this.#send();
  }

  #release_sticks() {
    this.#keys.clear();
    this.#base.release();
    this.#head.release();
  }

  /** Stop, and release control. */
  #give_wheels() {
    const mine = this.#has_wheels;
    this.#zero_count.drive = 0;
    this.#release_sticks();
    if (!mine || this.#is_giving) return;
    this.#is_giving = true;
    setTimeout(() => (this.#is_giving = false), GIVE_TIMEOUT);
    this.#watcher.send("drive", { ...this.#stamp(), ahead: 0, left: 0 });
    this.#watcher.send("give");
  }

  async #toggle_wheels() {
    if (this.#has_wheels) {
      this.#give_wheels();
      return;
    }
    try {
      const { yours } = await this.#watcher.ask("take");
      if (!yours) notify("The driver was asked for control.", "good");
    } catch (error) {
      notify(error);
    }
  }

  #show_state() {
    const { state, scene, lives } = this.#watcher;
    const operator = this.#link.welcome?.role === "operator";
    const mine = this.#has_wheels;
    if (!mine) this.#is_giving = false;
    const base = Boolean(scene?.parts.includes("base"));
    const asking = (state?.asking ?? []).filter((each) => each !== this.#link.welcome?.name);
    const has_asked = state?.asking?.includes(this.#link.welcome?.name);
    this.#take.disabled = !operator || !lives || !base || !this.#link.open || Boolean(has_asked);
    put(this.#take, mine ? "Release control" : state?.driver ? `Ask ${state.driver} for control` : "Take control");
    let words = "The mission drives.";
    if (!lives) words = "There is no run to drive.";
    else if (!base) words = "This run has no base to drive.";
    else if (!operator) words = "You can watch and stop.";
    else if (mine) words = state.stopped ? "The robot is stopped: hold “Hold to release” first." : this.#refusal ? "You have control." : `You drive.${state.paused ? " The mission is paused." : ""}`;
    else if (has_asked) words = `You have asked ${state.driver} for control.`;
    else if (state.driver) words = `${state.driver} drives.`;
    else if (state.stopped) words = `The robot was ${state.stopped}.`;
    else if (state.paused) words = "The mission is paused.";
    put(this.#status, words);
    this.#resume.hidden = !operator || !lives || !state.paused || Boolean(state.stopped);
    for (const stick of [this.#base, this.#head]) stick.toggleAttribute("disabled", !mine);
    this.#head.parentElement.hidden = Boolean(scene) && !scene.parts.includes("head");
    this.#request.hidden = !mine || !asking.length;
    if (!this.#request.hidden && this.#request.dataset.who !== asking[0]) {
      this.#request.dataset.who = asking[0];
      this.#request.replaceChildren(el("p", null, `${asking[0]} asks for control.`), button("Hand over", () => this.#give_wheels()));
    }
    const limits = scene?.limits;
    const share = this.#pace.value / 100;
    const turn = limits && Math.round((limits.turn * share * 180) / Math.PI);
    put(this.#limit, `${this.#pace.value} %${limits ? `: ${figure(limits.speed * share)} m/s, ${turn}°/s` : ""}`);
    this.node.classList.toggle("mine", mine);
    this.node.classList.toggle("none", !scene);
    this.#show_delay();
    this.#offer_start();
  }
}
