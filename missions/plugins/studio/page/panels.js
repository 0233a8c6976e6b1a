// Panels beside the tree: variables with their history, parts, joints, speech and the log.

import { el, put, svg } from "./dom.js";
import { line, plain, seconds, is_hidden, sized } from "./words.js";

const HISTORY = 60; // stored values of a variable
const LINES = 500;
const NUMBER = /^-?\d+(\.\d+)?(e[+-]?\d+)?/i;

/** Table of variables with their former values: a curve for numbers, else the previous text. */
export class Variables {
  node = el("table", { class: "variables" });
  #rows = new Map();
  #tree;

  /** `tree` gives the display names of the variables. */
  constructor(tree) {
    this.#tree = tree;
  }

  clear() {
    this.#rows.clear();
    this.node.replaceChildren();
  }

  show(variables, t) {
    for (const [name, value] of Object.entries(variables ?? {})) {
      const row = this.#rows.get(name) ?? this.#add(name);
      row.node.classList.toggle("gone", value === null);
      if (value === row.text) continue;
      if (row.text !== null && row.text !== undefined) put(row.was, `was ${row.text}`);
      row.text = value;
      put(row.value, value ?? "not set any more");
      const found = NUMBER.exec(value ?? "");
      if (!found) continue;
      row.past.push([t, Number(found[0])]);
      if (row.past.length > HISTORY) row.past.shift();
      this.#curve(row);
    }
  }

  #add(name) {
    const row = { past: [], value: el("td", { class: "value" }), was: el("span", { class: "was" }), curve: svg("polyline", { points: "" }) };
    row.drawing = svg("svg", { class: "curve", viewBox: "0 0 80 20", "aria-hidden": "true" }, row.curve);
    row.node = el("tr", null, el("th", { scope: "row" }, this.#tree.called(name)), row.value, el("td", { class: "before" }, row.drawing, row.was));
    this.#rows.set(name, row);
    this.node.append(row.node);
    return row;
  }

  #curve(row) {
    const values = row.past.map((each) => each[1]);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    if (values.length < 3 || low === high) return;
    const [t0, t1] = [row.past[0][0], row.past.at(-1)[0]];
    const x = (t) => (t1 > t0 ? (78 * (t - t0)) / (t1 - t0) + 1 : 1);
    const points = row.past.map(([t, value]) => `${x(t).toFixed(1)},${(18 - (16 * (value - low)) / (high - low) + 1).toFixed(1)}`);
    row.curve.setAttribute("points", points.join(" "));
    row.node.classList.add("curved");
  }
}

/** State of each part of the robot, and the battery. */
export class Parts {
  node = el("div", { class: "parts" });
  #rows = new Map();
  #battery = el("meter", { min: "0", max: "100", low: "25", optimum: "100", "aria-label": "Battery" });
  #percent = el("span");

  clear() {
    this.#rows.clear();
    this.node.replaceChildren();
  }

  show(parts) {
    for (const part of parts ?? []) {
      const row = this.#rows.get(part.part) ?? this.#add(part.part);
      row.node.className = `part ${part.level}`;
      put(row.level, part.level);
      const values = Object.entries(part.values ?? {}).filter(([name]) => name !== "battery").map(([name, value]) => sized(name, value));
      put(row.values, values.join(" · "));
      put(row.detail, [part.detail, part.hint && `Try: ${part.hint}`].filter(Boolean).join("\n"));
      if (part.part === "base" && part.values?.battery !== undefined) this.#charge(row, part.values.battery);
    }
  }

  #charge(row, percent) {
    if (!this.#battery.isConnected) row.node.append(el("span", { class: "battery" }, this.#battery, this.#percent));
    this.#battery.value = percent;
    put(this.#percent, `battery ${Math.round(percent)} %`);
  }

  #add(name) {
    const row = { level: el("span", { class: "level" }), values: el("span", { class: "figures" }), detail: el("span", { class: "detail" }) };
    row.node = el("div", null, el("b", null, plain(name)), row.level, row.values, row.detail);
    this.#rows.set(name, row);
    this.node.append(row.node);
    return row;
  }
}

export class Joints {
  node = el("table", { class: "joints" });
  #rows = new Map();

  clear() {
    this.#rows.clear();
    this.node.replaceChildren();
    this.panel.hidden = true;
  }

  show(joints) {
    for (const [name, [position, load, temperature]] of Object.entries(joints ?? {})) {
      const row = this.#rows.get(name) ?? this.#add(name);
      const degrees = (position * 180) / Math.PI;
      row.mark.setAttribute("cx", (60 + degrees / 3).toFixed(1));
      put(row.position, `${degrees.toFixed(0)}°`);
      put(row.load, `${Math.round(Math.abs(load) * 100)} %`);
      put(row.heat, `${Math.round(temperature)} °C`);
      row.node.classList.toggle("hot", temperature >= 60);
    }
    this.panel.hidden = !this.#rows.size;
  }

  #add(name) {
    if (!this.#rows.size) this.node.append(el("tr", null, ["joint", "", "position", "load", "temperature"].map((text) => el("th", { scope: "col" }, text))));
    const row = { mark: svg("circle", { cy: 6, r: 5 }), position: el("td"), load: el("td"), heat: el("td") };
    const drawing = svg("svg", { viewBox: "0 0 120 12", "aria-hidden": "true" }, svg("rect", { y: 5, width: 120, height: 2 }), row.mark);
    const label = el("th", { scope: "row" }, plain(name));
    row.node = el("tr", null, label, el("td", { class: "bar" }, drawing), row.position, row.load, row.heat);
    this.#rows.set(name, row);
    this.node.append(row.node);
    return row;
  }
}

export class Lines {
  #only;

  constructor(label, only) {
    this.#only = only;
    this.node = el("ol", { class: "lines", tabindex: "0", "aria-label": label });
  }

  clear() {
    this.node.replaceChildren();
  }

  add(events, lost = 0) {
    const rows = [];
    if (lost) rows.push(el("li", { class: "warn" }, el("span", null, `${lost} lines are missing: the connection was too slow`)));
    for (const event of events ?? []) {
      const [kind, text] = line(event);
      if (is_hidden(event) || (this.#only && !this.#only.includes(kind))) continue;
      rows.push(el("li", { class: kind, "data-t": String(event.t) }, el("time", null, seconds(event.t)), el("span", null, kind === "said" ? `“${text}”` : text)));
    }
    if (!rows.length) return; // reading the scroll position costs a layout of the page
    const low = this.node.scrollHeight - this.node.scrollTop - this.node.clientHeight < 40;
    this.node.append(...rows);
    while (this.node.childElementCount > LINES) this.node.firstChild.remove();
    if (low) this.node.scrollTop = this.node.scrollHeight;
  }
}
