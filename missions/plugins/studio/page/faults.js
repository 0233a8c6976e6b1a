// What goes wrong on request with a run in simulated time, in the words of test files: `camera frozen 2 s`.

import { button, choice, el, field, offer, panel, put, tell } from "./dom.js";

export class Faults {
  #link;
  #watcher;
  #what = choice([]);
  #time = el("input", { type: "text", value: "2 s", autocomplete: "off" });
  #strike = button("Inject fault", () => this.#happen());
  #form = el("div", { class: "faults" }, field("Fault", this.#what), field("Duration", this.#time, "Empty: until the run ends"), this.#strike);
  #about = el("p", { class: "hint", role: "status" });
  #told = "";

  constructor({ link, watcher }) {
    this.#link = link;
    this.#watcher = watcher;
    this.panel = panel("Faults", "mishaps", this.#form, this.#about);
    this.#what.addEventListener("change", () => this.#fit());
    this.clear();
  }

  clear() {
    this.#draw([]);
    put(this.#about, "");
  }

  async show() {
    const { examples, command } = await this.#watcher.ask("faults");
    this.#draw(examples);
    put(this.#about, examples.length ? "" : `Faults need simulated time: ${command}`);
  }

  #draw(examples) {
    const may = this.#link.welcome?.role === "operator";
    this.#form.hidden = !examples.length;
    this.#strike.disabled = !may;
    if (this.#told === String(examples)) return; // what has the keyboard keeps it
    this.#told = String(examples);
    offer(this.#what, examples);
    this.#fit();
  }

  /** Those that do not end by themselves, or say already for how long, take no time. */
  #fit() {
    this.#time.disabled = / battery | overloaded | turned |\d s$/.test(this.#what.value);
  }

  async #happen() {
    const words = this.#time.disabled ? this.#what.value : `${this.#what.value} ${this.#time.value}`.trim();
    try {
      await this.#watcher.ask("fault", { what: words });
      put(this.#about, `Injected: ${words}`);
    } catch (error) {
      tell(error);
    }
  }
}
