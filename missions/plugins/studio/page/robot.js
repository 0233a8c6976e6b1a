// Robot: health of its parts, values that can change in a run (trims, speeds, joint limits), and faults.

import { button, el, panel, put, notify } from "./dom.js";
import { Faults } from "./faults.js";
import { Joints, Parts } from "./panels.js";
import { plain, simulation_text } from "./words.js";

const DEGREES = 180 / Math.PI;
const UNITS = { speed: ["m/s", 1, 2], "turn rate": ["°/s", DEGREES, 0], angle: ["°", DEGREES, 1] };

export class Robot {
  #link;
  #watcher;
  #title = el("h1");
  #facts = el("p", { class: "facts" });
  #parts = new Parts();
  #joints = new Joints();
  #controls = el("div", { class: "knobs" });
  #file = el("p", { class: "hint", role: "status" });
  #write_button = button("Write to the robot file", () => this.#write_file());
  #drawn_text = "";
  #faults;

  constructor({ link, watcher }) {
    this.#link = link;
    this.#watcher = watcher;
    this.#faults = new Faults({ link, watcher });
    this.#joints.panel = panel("Joints", "arm", this.#joints.node);
    const about = el("p", { class: "hint" }, "Changes last until the run ends, unless you write them to the robot file. Its comments are kept. A new joint limit applies from the next movement on.");
    this.node = el("div", { class: "view robot" }, el("div", null, this.#title, this.#facts),
      el("div", { class: "columns two" }, el("div", null, panel("Parts", "robot", this.#parts.node), this.#joints.panel, this.#faults.panel),
        panel("Trims and limits", "tuning", about, this.#controls, el("div", { class: "actions" }, this.#write_button), this.#file)));
    watcher.addEventListener("which", () => this.#clear());
    watcher.addEventListener("scene", () => this.show());
    watcher.addEventListener("state", ({ detail }) => this.#state(detail));
    this.#clear();
  }

  async show() {
    const { scene, state, lives } = this.#watcher;
    this.node.classList.toggle("none", !scene);
    put(this.#title, scene ? plain(scene.robot) : "No run");
    put(this.#facts, scene ? `${plain(scene.mission)} · ${simulation_text(scene.simulated)}` : "Start a mission in Run to see its robot here.");
    if (state) this.#state(state);
    if (!lives) return;
    try {
      this.#draw(await this.#watcher.ask("tuning"));
      await this.#faults.show();
    } catch (error) {
      notify(error);
    }
  }

  hide() {}

  #clear() {
    this.#parts.clear();
    this.#joints.clear();
    this.#faults.clear();
    this.#controls.replaceChildren();
    this.#drawn_text = "";
    this.#write_button.disabled = true;
    put(this.#file, "");
  }

  #state(state) {
    if (!this.node.isConnected) return;
    this.#parts.show(state.parts);
    this.#joints.show(state.joints);
  }

  #draw({ file, knobs }) {
    const may = this.#link.welcome?.role === "operator";
    this.#write_button.disabled = !may || !knobs.some((each) => each.tuned);
    put(this.#file, file.split("/").at(-1));
    this.#file.title = file;
    const text = JSON.stringify([may, knobs]);
    if (text === this.#drawn_text) return; // unchanged: keep the focus
    this.#drawn_text = text;
    const groups = new Map();
    for (const knob of knobs) {
      const words = knob.name.split(".").filter((each) => each !== "joints");
      const title = words.slice(0, -1).join(" ");
      if (!groups.has(title)) groups.set(title, []);
      groups.get(title).push(this.#control(knob, words.at(-1), `${title} ${words.at(-1)}`, may));
    }
    this.#controls.replaceChildren(...[...groups].map(([title, controls]) => el("fieldset", null, el("legend", null, plain(title)), ...controls)));
  }

  #control(knob, name, label, may) {
    const [unit, factor, digits] = UNITS[knob.dimension];
    const figure = (value) => String(Number((value * factor).toFixed(digits)));
    const input = el("input", { type: "text", inputmode: "decimal", value: figure(knob.value), disabled: !may, autocomplete: "off",
      "aria-label": `${plain(label)} in ${unit}`, title: `${figure(knob.low)} to ${figure(knob.high)} ${unit}` });
    input.addEventListener("change", () => {
      const typed = Number(input.value.trim().replace(",", ".").replace("−", "-"));
      // The shown values are rounded: a typed bound means the exact bound.
      const value = [knob.low, knob.high].find((end) => figure(end) === String(typed)) ?? typed / factor;
      if (Number.isFinite(value)) this.#tune(knob.name, value);
      else notify(`${plain(label)}: “${input.value}” is not a number`);
    });
    return el("label", { class: knob.tuned ? "tune tuned" : "tune" }, el("span", null, plain(name)), el("span", { class: "joined" }, input, el("span", { class: "unit" }, unit)));
  }

  async #tune(name, value) {
    try {
      await this.#watcher.ask("tune", { name, value });
    } catch (error) {
      notify(error);
      this.#drawn_text = ""; // discard the typed value
    }
    await this.show();
  }

  async #write_file() {
    try {
      const { file, changes } = await this.#link.ask({ do: "keep_tuning", run: this.#watcher.run });
      notify(changes.length ? `Wrote to ${file}: ${changes.join("; ")}` : `${file} has these values already.`, "good");
    } catch (error) {
      notify(error);
    }
  }
}
