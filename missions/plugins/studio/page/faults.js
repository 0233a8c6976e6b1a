// Fault injection into a run in simulated time, in the words of test files: `camera frozen 2 s`.

import { button, choice, el, field, set_options, panel, put, notify } from "./dom.js";

export class Faults {
  #link;
  #watcher;
  #what = choice([]);
  #time = el("input", { type: "text", value: "2 s", autocomplete: "off" });
  #inject_button = button("Inject fault", () => this.#inject());
  #form = el("div", { class: "faults" }, field("Fault", this.#what), field("Duration", this.#time, "Empty: until the run ends"), this.#inject_button);
  #about = el("p", { class: "hint", role: "status" });
  #drawn_text = "";

  constructor({ link, watcher }) {
    this.#link = link;
    this.#watcher = watcher;
    this.panel = panel("Faults", "mishaps", this.#form, this.#about);
    this.#what.addEventListener("change", () => this.#update_time());
    this.clear();
  }

  clear() {
    this.#draw([]);
    put(this.#about, "");
  }

  async show() {
    const { examples, command } = await this.#watcher.ask("faults");
    this.#draw(examples);
    put(this.#about, examples.length ? "" : `Faults need simulated time. Try: ${command}`);
  }

  #draw(examples) {
    const may = this.#link.welcome?.role === "operator";
    this.#form.hidden = !examples.length;
    this.#inject_button.disabled = !may;
    if (this.#drawn_text === String(examples)) return; // unchanged: keep the focus
    this.#drawn_text = String(examples);
    set_options(this.#what, examples);
    this.#update_time();
  }

  #update_time() {
    this.#time.disabled = / battery | overloaded | turned |\d s$/.test(this.#what.value);
  }

  async #inject() {
    const words = this.#time.disabled ? this.#what.value : `${this.#what.value} ${this.#time.value}`.trim();
    try {
      await this.#watcher.ask("fault", { what: words });
      put(this.#about, `Injected: ${words}`);
    } catch (error) {
      notify(error);
    }
  }
}
