// Forms generated from declarations: params of a mission, and the robot or simulation.

import { choice, el, field, set_options, toggle } from "./dom.js";
import { heading, plain } from "./words.js";

const QUANTITY = /^\s*(-?[\d.]+)\s*([^\d\s][^\s]*)\s*$/;

/** Return the control of a param: its element, and functions to get and set its text. */
function control(param, people) {
  const { kind, choices, units } = param;
  const initial = param.default ?? "";
  if (choices?.length) return choice_control(choice(initial ? choices : [["", "choose"], ...choices], initial));
  if (kind === "flag") return flag_control(initial);
  if (kind === "person" && people.length) {
    return choice_control(choice([initial ? initial : ["", "choose"], ...people.filter((each) => each !== initial)], initial));
  }
  if (units?.length) {
    const found = QUANTITY.exec(initial);
    if (!initial || (found && units.includes(found[2]))) return quantity_control(units, found);
  }
  const numeric = kind === "number" || kind === "count";
  const input = el("input", { type: "text", value: initial, autocomplete: "off", ...(numeric && { inputmode: "decimal" }) });
  return { node: input, labelled: input, text: () => input.value.trim(), set: (text) => (input.value = text) };
}

function choice_control(select) {
  return { node: select, labelled: select, text: () => select.value, set: (text) => [...select.options].some((each) => each.value === text) && (select.value = text) };
}

function flag_control(initial) {
  const [yes, no] = /^(yes|no)$/.test(initial) ? ["yes", "no"] : ["true", "false"];
  const node = toggle("", initial === yes);
  return { node, labelled: node, text: () => (node.getAttribute("aria-checked") === "true" ? yes : no), set: (text) => node.setAttribute("aria-checked", String(text === yes)) };
}

function quantity_control(units, found) {
  const input = el("input", { type: "text", inputmode: "decimal", value: found?.[1] ?? "", autocomplete: "off" });
  const unit = choice(units, found?.[2] ?? units[0]);
  unit.setAttribute("aria-label", "unit");
  const node = el("span", { class: "joined" }, input, unit);
  const set = (text) => {
    const [, number, name] = QUANTITY.exec(text) ?? [];
    if (units.includes(name)) [input.value, unit.value] = [number, name];
  };
  return { node, labelled: input, text: () => (input.value.trim() ? `${input.value.trim()} ${unit.value}` : ""), set };
}

function help(param) {
  const { low, high } = param;
  const bounds = low && high ? `${low} to ${high}` : low ? `at least ${low}` : high ? `at most ${high}` : "";
  const example = param.of?.startsWith("{") ? "" : ": [one, two]";
  const list = param.kind === "list" ? `a list of ${param.of}${example}` : "";
  return [param.help, list, bounds, param.default === null ? "required" : ""].filter(Boolean).join(" · ");
}

export class Params {
  #controls = new Map();

  constructor(params, people) {
    const rows = params.map((param) => {
      const found = control(param, people);
      this.#controls.set(param, found);
      const row = field(plain(param.name), found.labelled, help(param));
      if (found.node !== found.labelled) {
        found.labelled.before(found.node);
        found.node.prepend(found.labelled);
        row.insertBefore(found.node, row.children[1]);
      }
      return row;
    });
    this.node = el("div", { class: "fields" }, rows.length ? rows : el("p", { class: "hint" }, "This mission has no parameters."));
  }

  /** Texts of all params with a value. */
  get texts() {
    return Object.fromEntries([...this.#controls].map(([param, { text }]) => [param.name, text()]).filter(([, text]) => text));
  }

  keep(former) {
    const { values } = former.changed;
    for (const [param, { set }] of this.#controls) if (param.name in values) set(values[param.name]);
  }

  /** Values that differ from the defaults, and the first required param without a value. */
  get changed() {
    const values = {};
    let missing = null;
    for (const [param, { text }] of this.#controls) {
      const value = text();
      if (param.default === null && !value) missing ??= param;
      else if (value !== (param.default ?? "")) values[param.name] = value;
    }
    return { values, missing };
  }

  /** Changed values, as texts. Throws an Error that names a missing param. */
  get values() {
    const { values, missing } = this.changed;
    if (!missing) return values;
    this.#controls.get(missing).labelled.focus();
    throw new Error(`“${plain(missing.name)}” is required.`);
  }
}

const SIMULATIONS = [
  ["fast", "in simulated time (fast)"],
  ["wire", "in real time (wire)"],
];
const SPEEDS = [["0.2", "0.2 ×"], ["0.5", "0.5 ×"], ["1", "real time"], ["2", "2 ×"], ["5", "5 ×"], ["20", "20 ×"], ["", "as fast as possible"]];

/** Choice of simulation or real robot; kept from mission to mission. */
export class Target {
  #real = false;

  constructor(library) {
    this.robot = choice([]);
    this.world = choice([]);
    this.update(library);
    this.how = choice(SIMULATIONS);
    this.speed = choice(SPEEDS, "1");
    this.options = library.options;
    this.seed = el("input", { type: "text", inputmode: "numeric", value: String(this.options.seed.default), size: "6" });
    this.sure = toggle("I have checked: the robot has room to move, and I can reach its emergency stop.", false);
    this.sure.classList.add("sure");
    const kinds = el("div", { class: "segments", role: "radiogroup", "aria-label": "Where it runs" });
    this.kinds = [["Simulated", false], ["On the robot", true]].map(([text, real]) => {
      const input = el("input", { type: "radio", name: "real", onchange: () => this.#choose(real), ...(!real && { checked: true }) });
      kinds.append(el("label", null, input, el("span", null, text)));
      return input;
    });
    this.paced = field("Speed", this.speed, this.options.speed.help);
    const seed = field("Seed", this.seed, this.options.seed.help);
    this.simulated = el("div", { class: "fields two" }, field("World", this.world, this.options.world.help), field("Simulation", this.how), this.paced, seed);
    this.moving = el("div", { class: "warning", hidden: true }, el("p", null, "The robot will move."), this.sure);
    this.how.addEventListener("change", () => (this.paced.hidden = this.how.value !== "fast"));
    this.node = el("div", { class: "target" }, kinds, field("Robot", this.robot), this.simulated, this.moving);
  }

  /** Update the choices of robots and worlds. */
  update({ robots, worlds, robot }) {
    const named = (each) => [each.name, [heading(each), each.trouble ? "has errors" : each.summary].filter(Boolean).join(": ")];
    this.usual = `default: ${plain(robot)}`;
    set_options(this.robot, [["", this.#real ? "choose" : this.usual], ...robots.map(named)]);
    set_options(this.world, [["", "default"], ...worlds.map(named)]);
  }

  /** Whether a robot would move. */
  get real() {
    return this.#real;
  }

  #choose(real) {
    this.#real = real;
    this.simulated.hidden = real;
    this.moving.hidden = !real;
    this.robot.options[0].text = real ? "choose" : this.usual;
    this.reset_confirmation();
    this.node.dispatchEvent(new Event("change"));
  }

  /** Reset the confirmation, which holds for one run. */
  reset_confirmation() {
    this.sure.setAttribute("aria-checked", "false");
  }

  /** Return the members of `start`, or of `add_task` if `later`. Throws an Error that names a missing choice. */
  members(later = false) {
    if (this.#real) {
      if (!this.robot.value) throw new Error("Choose the robot first.");
      if (this.sure.getAttribute("aria-checked") !== "true") throw new Error("Confirm first that the robot has room and that you can reach its emergency stop.");
      return { robot: this.robot.value, sure: true };
    }
    const found = { robot: this.robot.value, simulate: this.how.value, world: this.world.value };
    if (later) return found;
    const seed = Number(this.seed.value);
    const { low } = this.options.seed;
    if (!Number.isSafeInteger(seed) || seed < low) throw new Error(`The seed must be a whole number of at least ${low}.`);
    return { ...found, seed, ...(this.how.value === "fast" && this.speed.value && { speed: Number(this.speed.value) }) };
  }
}
