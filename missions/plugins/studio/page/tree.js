// The tree as nested blocks with status, time and reason of each node. Only changed blocks are updated.

import { FRAME_BUDGET, before_frame, button, el, put, on_frame } from "./dom.js";
import { filled, whole } from "./values.js";
import { SIGNS, isActive, seconds } from "./words.js";

const MAX_FRAME_TIME = 40; // milliseconds of a frame above which the next one updates fewer rows
const [MIN_ROWS, MAX_ROWS] = [4, 64]; // rows updated in a frame
const CLOCK_INTERVAL = 250; // milliseconds between updates of the running times

/** A block of the tree with its status. */
class Block {
  status = "idle";
  visited = false;
  reason = "";
  since = null;

  constructor(node, parent, list) {
    this.parent = parent;
    this.children = [];
    this.key = node.key;
    this.arguments = node.arguments;
    this.scope = parent && (parent.mission ? parent : parent.scope); // block of the sub-mission around it, if any
    this.mission = node.mission;
    this.name = this.written = [node.case && `${node.case}:`, node.title].filter(Boolean).join(" ");
    this.texts = []; // texts with placeholders: element, and text of the file
    const details = Object.entries(node.arguments).filter(([, value]) => value !== node.said).map(([name, value]) => `${name}: ${value}`);
    if (node.as) details.push(`as: ${node.as}`);
    this.sign = el("span", { class: "sign", "aria-hidden": "true" }, SIGNS.idle);
    this.why = el("span", { class: "why" });
    this.time = el("span", { class: "time" });
    this.badges = new Map();
    const badges = node.modifiers.map((each) => {
      const badge = this.text("badge", `${each.kind} ${each.text}`.trim());
      this.badges.set(each.key, badge);
      return badge;
    });
    const has_children = node.children.length > 0;
    this.fold = has_children && button("▾", () => this.toggle(), { class: "fold", tabindex: "-1", "aria-hidden": "true" });
    this.row = el("div", { class: "row" },
      this.fold, this.sign,
      el("span", { class: "symbol", "aria-hidden": "true" }, node.symbol),
      node.case && el("span", { class: "case" }, node.case),
      this.text("title", node.title),
      badges,
      details.length > 0 && this.text("told", details.join(", ")),
      this.time, this.why);
    this.item = el("li", { role: "treeitem", class: "node idle", tabindex: "-1", ...(has_children && { "aria-expanded": "true" }) }, this.row);
    this.item.block = this;
    this.inner = has_children && el("ul", { role: "group" });
    if (has_children) this.item.append(this.inner);
    list.append(this.item);
    this.label();
  }

  text(kind, text) {
    const node = el("span", { class: kind }, text);
    if (text.includes("${")) this.texts.push([node, text]);
    return node;
  }

  fill(value) {
    for (const [node, text] of this.texts) {
      const pieces = filled(text, value);
      if (node.textContent === pieces.map((piece) => (Array.isArray(piece) ? piece[0] : piece)).join("")) continue;
      node.replaceChildren(...pieces.map((piece) => (Array.isArray(piece) ? el("span", { class: "filled", title: piece[1] }, piece[0]) : piece)));
    }
    if (!this.texts.length) return;
    this.name = whole(this.written, value) ?? this.written;
    this.label();
  }

  label() {
    const why = this.reason ? `, ${this.reason}` : "";
    this.item.setAttribute("aria-label", `${this.name}: ${this.status}${why}`);
  }

  get folded() {
    return this.inner && this.item.getAttribute("aria-expanded") === "false";
  }

  toggle(folded = !this.folded) {
    if (!this.inner || folded === this.folded) return;
    this.item.setAttribute("aria-expanded", String(!folded));
    put(this.fold, folded ? "▸" : "▾");
  }

  set(status, reason, since) {
    if (status !== this.status) {
      this.item.classList.replace(this.status, status);
      put(this.sign, SIGNS[status] ?? "?");
      this.status = status;
    }
    if (reason !== this.reason) put(this.why, (this.reason = reason));
    this.since = since;
    this.label();
  }

  tick(t) {
    const text = isActive(this.status) && this.since !== null ? seconds(Math.max(0, t - this.since)) : "";
    put(this.time, text);
  }
}

export class Tree extends HTMLElement {
  #blocks = new Map();
  #badges = new Map();
  #now = new Map();
  #pending = new Map();
  #paint = on_frame(() => this.#patch(), 80);
  #scroll = on_frame(() => this.#scroll_to_running(), 300); // costs a layout of the page
  #t = 0;
  #visited = [];
  #due_clocks = new Set(); // blocks whose running time is outdated
  #row_budget = MAX_ROWS; // rows to update in the next frame
  #clocks_at = 0;
  #drawn_text = "";
  #pending_nodes = []; // nodes without a block yet
  #add_more = () => this.#add();
  #missions = new Map(); // names of sub-missions by the keys of their nodes
  #first = {}; // values of variables before the run reports them
  #values = {};
  #are_values_stale = false; // whether blocks show outdated values
  follow = false;

  draw(drawing, first = {}) {
    this.#first = first;
    this.values({}, true);
    const text = JSON.stringify(drawing.tree);
    if (text !== this.#drawn_text) {
      this.clear();
      this.#drawn_text = text;
      const root = el("ul", { role: "tree", "aria-label": `Tree of ${drawing.mission}` });
      this.#pending_nodes = [[drawing.tree, null, root]];
      const all = [drawing.tree];
      for (const node of all) all.push(...node.children);
      this.#missions = new Map(all.filter((node) => node.mission).map((node) => [node.key, node.mission]));
      root.addEventListener("keydown", (event) => this.#key(event));
      root.addEventListener("focusin", (event) => this.#move_focus(event.target.closest("li")));
      this.#add();
      root.firstChild.tabIndex = 0;
      this.append(root);
    }
    this.show({}, 0, true);
  }

  /** Remove the tree. */
  clear() {
    this.#drawn_text = "";
    this.#pending_nodes = [];
    this.#blocks.clear();
    this.#badges.clear();
    this.#now.clear();
    this.#pending.clear();
    this.#due_clocks.clear();
    this.#visited = [];
    this.replaceChildren();
  }

  visit(keys) {
    this.#visited = keys;
    this.#paint();
  }

  values(values, all = false) {
    this.#values = { ...(all ? {} : this.#values), ...values };
    this.#are_values_stale = true;
    this.#paint();
  }

  called(variable) {
    const [, key, name] = /^([\d.]+) (.*)$/.exec(variable) ?? [];
    const inner = this.#missions.get(key);
    return inner ? `${inner}: ${name}` : variable;
  }

  #value(name, scope) {
    const key = scope ? `${scope.key} ${name}` : name;
    const given = scope?.arguments[name];
    return this.#values[key] ?? (given && whole(given, (outer) => this.#value(outer, scope.scope))) ?? this.#first[key] ?? undefined;
  }

  /** Set statuses by node key at time t; with `whole`, all other nodes are idle. */
  show(changed, t, whole = false) {
    this.#t = t;
    if (whole) for (const key of this.#now.keys()) if (!(key in changed)) this.#pending.set(key, ["idle", "", null]);
    for (const key of Object.keys(changed)) this.#pending.set(key, changed[key]);
    this.#paint();
  }

  /** Fold all blocks below the root, or unfold all. */
  fold(folded) {
    for (const block of this.#blocks.values()) block.toggle(folded && block.parent !== null);
  }

  #add() {
    const until = performance.now() + FRAME_BUDGET;
    while (this.#pending_nodes.length && performance.now() < until) {
      const [node, parent, list] = this.#pending_nodes.pop();
      const block = new Block(node, parent, list);
      parent?.children.push(block);
      this.#blocks.set(node.key, block);
      for (const [key, badge] of block.badges) this.#badges.set(key, badge);
      for (const child of node.children.toReversed()) this.#pending_nodes.push([child, block, block.inner]);
    }
    this.#are_values_stale = true;
    if (this.#pending_nodes.length) before_frame(this.#add_more);
    else this.#paint();
  }

  #patch() {
    if (this.#pending_nodes.length) return; // wait until all blocks exist
    const now = performance.now();
    if (this.#are_values_stale) for (const block of this.#blocks.values()) if (block.texts.length) block.fill((name) => this.#value(name, block.scope));
    this.#are_values_stale = false;
    if (now - this.#clocks_at > CLOCK_INTERVAL) {
      this.#clocks_at = now;
      for (const block of this.#blocks.values()) if (isActive(block.status)) this.#due_clocks.add(block);
    }
    let left = this.#row_budget;
    for (const block of [...this.#due_clocks].slice(0, left >> 2)) {
      left -= 1;
      this.#due_clocks.delete(block);
      block.tick(this.#t);
    }
    for (const [key, [status, reason, since]] of this.#pending) {
      if (left-- <= 0) break;
      this.#pending.delete(key);
      this.#now.set(key, status);
      const block = this.#blocks.get(key);
      if (block) {
        block.set(status, reason ?? "", since ?? null);
        block.tick(this.#t);
        if (this.follow) this.#scroll();
      } else if (this.#badges.has(key)) Object.assign(this.#badges.get(key), { className: `badge ${status}`, title: reason ?? "" });
    }
    const visited = new Set(this.#visited);
    for (const [key, block] of this.#blocks) {
      if (block.visited !== visited.has(key)) block.item.classList.toggle("visited", (block.visited = !block.visited));
    }
    if (this.#pending.size || this.#due_clocks.size) this.#paint();
    // Layout and painting cost more than this script: measured after the frame.
    setTimeout(() => (this.#row_budget = performance.now() - now > MAX_FRAME_TIME ? Math.max(MIN_ROWS, this.#row_budget >> 1) : Math.min(MAX_ROWS, this.#row_budget + 1)));
  }

  #scroll_to_running() {
    let block = this.#blocks.values().next().value;
    if (!isActive(block?.status)) return;
    for (let next = block; next; next = block.children.find((each) => isActive(each.status))) {
      block = next;
      if (block.children.some((each) => isActive(each.status))) block.toggle(false);
    }
    const [mine, row] = [this.getBoundingClientRect(), block.row.getBoundingClientRect()];
    if (row.top < mine.top) this.scrollTop += row.top - mine.top - 8;
    else if (row.bottom > mine.bottom) this.scrollTop += row.bottom - mine.bottom + 8;
  }

  #move_focus(item) {
    if (!item) return;
    for (const old of this.querySelectorAll("li[tabindex='0']")) old.tabIndex = -1;
    item.tabIndex = 0;
  }

  #key(event) {
    const item = event.target.closest("li");
    const block = item?.block;
    if (!block) return;
    const seen = [...this.querySelectorAll("li")].filter((each) => !each.parentElement.closest("li[aria-expanded=false]"));
    const at = seen.indexOf(item);
    const to = { ArrowDown: seen[at + 1], ArrowUp: seen[at - 1], Home: seen[0], End: seen.at(-1) }[event.key];
    if (event.key === "ArrowRight" && block.inner) block.folded ? block.toggle(false) : block.children[0].item.focus();
    else if (event.key === "ArrowLeft") block.inner && !block.folded ? block.toggle(true) : block.parent?.item.focus();
    else if (event.key === "Enter") block.toggle();
    else if (!to && !["ArrowDown", "ArrowUp", "Home", "End"].includes(event.key)) return;
    to?.focus();
    event.preventDefault();
    event.stopPropagation();
  }
}

customElements.define("studio-tree", Tree);
