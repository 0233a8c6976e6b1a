// Failsafe: the reaction of a base to a fault, step by step.

import { button, choice, el, field, panel, put, notify } from "./dom.js";

const NAMES = { who: "Controlled by", wish: "Motion", fault: "Fault", battery: "Battery", reflexes: "Reflexes" };
const REPLY_TIMEOUT = 20000; // milliseconds; the first reply waits for a reader process to start

export class Failsafe {
  #link;
  #chosen = {};
  #steps = [];
  #at = 0;
  #request_count = 0;
  #form = el("div", { class: "target two" });
  #about = el("p", { class: "hint" });
  #clock = el("output", { class: "clock", "aria-live": "polite" });
  #list = el("ol", { class: "steps", "aria-label": "What the base does" });

  constructor({ link }) {
    this.#link = link;
    const tools = el("div", { class: "tools" }, button("Previous", () => this.#go(this.#at - 1)), button("Next", () => this.#go(this.#at + 1)), this.#clock);
    this.node = el("div", { class: "view failsafe" }, panel("Failsafe", "failsafe", this.#about, this.#form, tools, this.#list));
  }

  show() {
    this.#fetch();
  }

  hide() {}

  async #fetch() {
    if (!this.#link.open) return;
    const number = (this.#request_count += 1);
    try {
      const { robot, choices, chosen, moments } = await this.#link.ask({ do: "failsafe", ...this.#chosen }, REPLY_TIMEOUT);
      if (number !== this.#request_count) return; // another choice was made in the meantime
      if (!this.#form.childElementCount) this.#draw(choices, chosen);
      put(this.#about, `Computed, nothing moves: how the base of ${robot} reacts to a fault at 0 s. A mission or person repeats the command after each failure.`);
      this.#steps = moments.map(({ t, ahead, words }) =>
        el("li", null, el("b", null, `${t.toFixed(2)} s`), el("span", null, words), el("em", null, `${(100 * ahead).toFixed(0)} cm since the fault`)));
      this.#list.replaceChildren(...this.#steps);
      this.#go(Math.max(0, moments.findIndex((each) => each.t >= 0)));
    } catch (error) {
      notify(error);
    }
  }

  #draw(choices, chosen) {
    for (const [name, words] of Object.entries(choices)) {
      const select = choice(words, chosen[name]);
      select.addEventListener("change", () => {
        this.#chosen[name] = select.value;
        this.#fetch();
      });
      this.#form.append(field(NAMES[name] ?? name, select));
    }
  }

  #go(at) {
    this.#at = Math.min(Math.max(at, 0), this.#steps.length - 1);
    this.#steps.forEach((each, number) => (number === this.#at ? each.setAttribute("aria-current", "step") : each.removeAttribute("aria-current")));
    put(this.#clock, this.#steps[this.#at]?.firstChild.textContent ?? "");
  }
}
