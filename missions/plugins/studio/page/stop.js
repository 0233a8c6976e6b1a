// STOP: visible in every view, for every role, over connections of its own.

import { button, el, put, notify } from "./dom.js";
import { Link } from "./link.js";
import { UNKNOWN } from "./watch.js";

const PROTOCOL = "2";
const RETRY_INTERVAL = 250; // milliseconds between tries, until a stop is answered
const REPLY_TIMEOUT = 3000; // milliseconds; a hanging run delays the answer
const REMEDY = "Press the emergency stop on the robot or switch it off.";
const DOUBT_TEXT = "PERHAPS NOT STOPPED";
const HOLD_TIME = 1000; // milliseconds for which release must be held
const SECOND_PRESS_TIME = 4000; // milliseconds for the second press, without a pointer or key to hold

const TEXT_INPUTS = new Set(["text", "search", "number", "email", "url", "tel", "password"]);

/** Return whether the space bar types a space in a node; there, Escape stops. */
function is_text_field(node) {
  return node instanceof HTMLTextAreaElement || node?.isContentEditable || (node instanceof HTMLInputElement && TEXT_INPUTS.has(node.type));
}

function unreached_text(runs) {
  return runs.filter((each) => each.trouble).map(({ run, trouble }) => (run === UNKNOWN ? trouble : `run ${run}: ${trouble}`)).join("\n");
}

export class Stop extends HTMLElement {
  #main = null;
  // By the protocol's version, so that STOP works on an outdated page. Two, since a lost TCP segment delays one.
  #stop_links = [new Link(PROTOCOL), new Link(PROTOCOL)];
  #watcher = null;
  #latched = new Map(); // by run: client that stopped it, and the number of the stop
  #pending = false;
  #doubt = ""; // reason why something may not have been stopped
  #unreached = ""; // reason why a stop may not reach something
  #press = "";
  #timer = 0;
  #button = el("button", { type: "button", class: "stop" }, el("span", null, "STOP"), el("small", null, "space bar, in text Esc"));
  #message = el("p", { class: "said", role: "alert" });
  #release = button("Hold to release", null, { class: "release", hidden: true });

  connectedCallback() {
    this.append(this.#button, el("div", { class: "latched" }, this.#message, this.#release));
    // The press, not its click; a click without a pointer comes from a screen reader or key.
    this.#button.addEventListener("pointerdown", () => this.stop());
    this.#button.addEventListener("click", (event) => event.detail === 0 && this.stop());
    addEventListener("keydown", (event) => this.#key(event), { capture: true });
    addEventListener("keyup", (event) => event.key === " " && !is_text_field(event.target) && event.preventDefault(), { capture: true });
    for (const link of this.#stop_links) {
      link.on("how", () => {
        if (this.#pending) this.#send();
        this.#show();
      });
      link.on("runs", (message) => this.#on_runs(message.runs));
    }
    this.#listen_for_release();
    this.#follow_viewport();
  }

  /** Use the main connection too, and follow the stops of the `watcher`'s run. */
  begin(link, watcher) {
    this.#main = link;
    this.#watcher = watcher;
    watcher.addEventListener("state", ({ detail }) => "stopped" in detail && this.#latch(watcher.run, detail.stopped, detail.stops));
    watcher.addEventListener("over", () => this.#latch(watcher.run, "", 0));
    link.on("how", () => this.#show());
  }

  /** Reconnect the stop connections with the present cookie. */
  retry() {
    for (const link of this.#stop_links) link.retry(true);
  }

  get #links() {
    return [...this.#stop_links, this.#main].filter(Boolean);
  }

  /** Whether a stop is latched. */
  get latched() {
    return this.#latched.size > 0;
  }

  /** Stop all runs of this user; repeated until it is answered. */
  stop() {
    this.#pending = true;
    this.#doubt = "";
    this.#press = `${Date.now()} ${Math.random()}`; // so that a press that arrives over several connections counts once
    this.dispatchEvent(new Event("stop"));
    this.#show();
    this.#send();
  }

  #key(event) {
    const wanted = is_text_field(event.target) ? event.key === "Escape" : event.key === " ";
    if (!wanted || event.isComposing) return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (!event.repeat) this.stop();
  }

  #send() {
    clearTimeout(this.#timer);
    // Over all at once: TCP resends a lost segment late, and holds back all behind it.
    for (const link of this.#links) {
      if (link.open) link.ask({ do: "stop", press: this.#press }, REPLY_TIMEOUT).then((result) => this.#on_answer(result), (error) => this.#on_error(error));
    }
    this.#timer = setTimeout(() => this.#pending && this.#send(), RETRY_INTERVAL);
  }

  #on_answer({ stopped = {} }) {
    this.#pending = false;
    clearTimeout(this.#timer);
    for (const [run, found] of Object.entries(stopped)) {
      if ("stops" in found) this.#latch(run, "stopped from this page", found.stops, true);
    }
    const doubts = unreached_text(Object.entries(stopped).map(([run, found]) => ({ run, ...found })));
    this.#doubt = doubts && `${DOUBT_TEXT}: ${doubts}`;
    const ended = Object.values(stopped).flatMap((found) => found.ended ?? []);
    this.#show(ended.length ? `Ended: ${ended.join("; ")}` : Object.keys(stopped).length ? "" : "No runs; nothing to stop.");
  }

  #on_error(error) {
    if (error.error === "lost" || error.error === "no_answer" || error.error === "too_many") return; // the timer tries again
    this.#pending = false;
    this.#doubt = `${DOUBT_TEXT}: ${error.message}`;
    notify(error);
    this.#show();
  }

  #on_runs(runs) {
    const there = new Map(runs.map((each) => [each.run, each]));
    for (const run of [...this.#latched.keys()]) if (!there.has(run)) this.#latched.delete(run);
    this.#unreached = unreached_text(runs);
    for (const [run, each] of there) if ("stopped" in each) this.#latch(run, each.stopped, each.stops);
    this.#show();
  }

  /** Store the stop of a run; `is_answer` if it comes from the answer, before the run reports it. */
  #latch(run, by, number, is_answer = false) {
    const before = this.#latched.get(run);
    if (before && number < before.number && number > 0) return; // sent before the run had received the stop
    if (by) this.#latched.set(run, { by: is_answer && before?.number === number ? before.by : by, number });
    else if (!this.#latched.delete(run)) return;
    this.#show();
  }

  /** Return the text for the client that stopped: this page, over any of its connections, or another client. */
  #stopped_by(by) {
    const mine = this.#links.map((link) => link.welcome?.name);
    return mine.includes(by.replace(/^stopped by /, "")) ? "stopped from this page" : by;
  }

  #show(text = "") {
    const lost = !this.#links.some((link) => link.open);
    let said = text;
    if (this.#pending) said = lost ? `NOT STOPPED: no connection. ${REMEDY}` : "Stopping…";
    else if (this.#doubt) said = `${this.#doubt}\n${REMEDY}`;
    else if (this.latched) said = [...new Set([...this.#latched.values()].map((each) => this.#stopped_by(each.by)))].join("; ");
    else if (lost) said = `No connection: STOP does not reach the robot. ${REMEDY}`;
    else if (!text && this.#unreached) said = `STOP may not reach every run: ${this.#unreached}`;
    put(this.#message, said);
    this.classList.toggle("is-latched", this.latched);
    document.body.classList.toggle("is-stopped", this.latched);
    this.classList.toggle("is-pending", this.#pending);
    this.classList.toggle("is-lost", lost);
    this.classList.toggle("is-doubtful", Boolean(this.#doubt) && !this.#pending);
    this.#release.hidden = !this.latched || this.#pending || this.#main?.welcome?.role !== "operator";
    if (text) setTimeout(() => this.#message.textContent === text && put(this.#message, ""), 3000);
  }

  // --- release: a second, deliberate act

  #listen_for_release() {
    const release = this.#release;
    let timer = 0;
    let armed = 0;
    const begin = () => {
      release.classList.add("held");
      clearTimeout(timer);
      timer = setTimeout(() => {
        end();
        this.#release_all();
      }, HOLD_TIME);
    };
    const end = () => {
      clearTimeout(timer);
      release.classList.remove("held");
    };
    release.addEventListener("pointerdown", begin);
    for (const type of ["pointerup", "pointerleave", "pointercancel", "blur"]) release.addEventListener(type, end);
    release.addEventListener("contextmenu", (event) => event.preventDefault());
    release.addEventListener("keydown", (event) => event.key === "Enter" && (event.preventDefault(), event.repeat || begin()));
    release.addEventListener("keyup", end);
    // Neither pointer nor key: a screen reader or a switch cannot hold. Two presses, not too quickly.
    release.addEventListener("click", (event) => {
      if (event.detail !== 0) return;
      const since = performance.now() - armed;
      if (since > 500 && since < SECOND_PRESS_TIME) this.#release_all();
      armed = performance.now();
      put(this.#message, "Press release again to let the robot move.");
    });
  }

  async #release_all() {
    for (const [run, { number }] of [...this.#latched]) {
      try {
        await this.#main.ask({ do: "release", run, stop: number });
        this.#latched.delete(run);
        const go = button("Resume", () => this.#main.ask({ do: "resume", run }).catch(notify));
        notify(run === this.#watcher.run ? "Released. The mission is paused." : `Run ${run} is released, and paused.`, "good", go);
      } catch (error) {
        if (error.error === "no_such_run" || error.error === "not_stopped") this.#latched.delete(run);
        notify(error);
      }
    }
    this.#show();
  }

  /** Keep STOP visible while a phone's keyboard or a zoom moves the visible part of the page. */
  #follow_viewport() {
    const seen = window.visualViewport;
    if (!seen) return;
    const root = document.documentElement.style;
    const place = () => {
      const low = Math.max(0, Math.round(innerHeight - seen.height - seen.offsetTop));
      const high = Math.max(0, Math.round(seen.offsetTop));
      // Setting a property of the root redraws the whole page, even with the same value.
      for (const [name, value] of [["--low", `${low}px`], ["--high", `${high}px`]]) {
        if (root.getPropertyValue(name) !== value && (value !== "0px" || root.getPropertyValue(name))) root.setProperty(name, value);
      }
    };
    seen.addEventListener("resize", place);
    seen.addEventListener("scroll", place);
  }
}

customElements.define("studio-stop", Stop);
