// The tree as nested blocks: what each node does, since when and why. Only what has changed is touched.

import { SHARE, before_picture, button, el, put, soon } from "./dom.js";
import { filled, whole } from "./values.js";
import { SIGNS, isActive, seconds } from "./words.js";

const LONGEST = 40; // milliseconds of a picture of the screen, above which the next one has fewer new rows
const [FEWEST, MOST] = [4, 64]; // new rows of a picture
const TICKING = 250; // milliseconds from one renewal of "for 3.2 s" to the next

/** One block, and how it stands. */
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
    this.scope = parent && (parent.mission ? parent : parent.scope); // the sub-mission that it is in, if any
    this.mission = node.mission;
    this.name = this.written = [node.case && `${node.case}:`, node.title].filter(Boolean).join(" ");
    this.texts = []; // those with values in them: the element, and the text as it is written
    const told = Object.entries(node.arguments).filter(([, value]) => value !== node.said).map(([name, value]) => `${name}: ${value}`);
    if (node.as) told.push(`as: ${node.as}`);
    this.sign = el("span", { class: "sign", "aria-hidden": "true" }, SIGNS.idle);
    this.why = el("span", { class: "why" });
    this.time = el("span", { class: "time" });
    this.badges = new Map();
    const badges = node.modifiers.map((each) => {
      const badge = this.text("badge", `${each.kind} ${each.text}`.trim());
      this.badges.set(each.key, badge);
      return badge;
    });
    const many = node.children.length > 0;
    this.fold = many && button("▾", () => this.toggle(), { class: "fold", tabindex: "-1", "aria-hidden": "true" });
    this.row = el("div", { class: "row" },
      this.fold, this.sign,
      el("span", { class: "symbol", "aria-hidden": "true" }, node.symbol),
      node.case && el("span", { class: "case" }, node.case),
      this.text("title", node.title),
      badges,
      told.length > 0 && this.text("told", told.join(", ")),
      this.time, this.why);
    this.item = el("li", { role: "treeitem", class: "node idle", tabindex: "-1", ...(many && { "aria-expanded": "true" }) }, this.row);
    this.item.block = this;
    this.inner = many && el("ul", { role: "group" });
    if (many) this.item.append(this.inner);
    list.append(this.item);
    this.label();
  }

  /** Return an element with a text, in which values may be. */
  text(kind, text) {
    const node = el("span", { class: kind }, text);
    if (text.includes("${")) this.texts.push([node, text]);
    return node;
  }

  /** Show values in place of what stands for them, which is told where the mouse rests on them. */
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
  #waiting = new Map();
  #paint = soon(() => this.#patch(), 80);
  #scroll = soon(() => this.#reveal(), 300); // it costs a layout of the page
  #t = 0;
  #visited = [];
  #due = new Set(); // blocks whose time is to be renewed
  #most = MOST; // new rows of the next picture
  #ticked = 0;
  #drawn = "";
  #adding = []; // nodes whose blocks are not there yet
  #more = () => this.#add();
  #missions = new Map(); // what sub-missions are called, by the keys of their nodes
  #first = {}; // values of variables before the run has told of them
  #values = {};
  #stale = false; // whether blocks show former values
  follow = false;

  /** Draw a tree, unless it is the one that is drawn; all nodes are idle then. `first` are values of its variables. */
  draw(drawing, first = {}) {
    this.#first = first;
    this.values({}, true);
    const text = JSON.stringify(drawing.tree);
    if (text !== this.#drawn) {
      this.clear();
      this.#drawn = text;
      const root = el("ul", { role: "tree", "aria-label": `Tree of ${drawing.mission}` });
      this.#adding = [[drawing.tree, null, root]];
      const all = [drawing.tree];
      for (const node of all) all.push(...node.children);
      this.#missions = new Map(all.filter((node) => node.mission).map((node) => [node.key, node.mission]));
      root.addEventListener("keydown", (event) => this.#key(event));
      root.addEventListener("focusin", (event) => this.#roam(event.target.closest("li")));
      this.#add();
      root.firstChild.tabIndex = 0;
      this.append(root);
    }
    this.show({}, 0, true);
  }

  /** Draw nothing. */
  clear() {
    this.#drawn = "";
    this.#adding = [];
    this.#blocks.clear();
    this.#badges.clear();
    this.#now.clear();
    this.#waiting.clear();
    this.#due.clear();
    this.#visited = [];
    this.replaceChildren();
  }

  /** Say which nodes, by their keys, the last tick has visited. */
  visit(keys) {
    this.#visited = keys;
    this.#paint();
  }

  /** Say what variables hold, by their names as `state` has them; with `all`, of others nothing is known. */
  values(values, all = false) {
    this.#values = { ...(all ? {} : this.#values), ...values };
    this.#stale = true;
    this.#paint();
  }

  /** Return what a variable is called: that of a sub-mission, which comes with the key of its node, by that one's name. */
  called(variable) {
    const [, key, name] = /^([\d.]+) (.*)$/.exec(variable) ?? [];
    const inner = this.#missions.get(key);
    return inner ? `${inner}: ${name}` : variable;
  }

  /** Return what a name stands for in a sub-mission, or in the mission itself; undefined where that is not known. */
  #value(name, scope) {
    const key = scope ? `${scope.key} ${name}` : name;
    const given = scope?.arguments[name];
    return this.#values[key] ?? (given && whole(given, (outer) => this.#value(outer, scope.scope))) ?? this.#first[key] ?? undefined;
  }

  /** Say how nodes stand at `t`, by their keys; with `whole`, all others are idle. */
  show(changed, t, whole = false) {
    this.#t = t;
    if (whole) for (const key of this.#now.keys()) if (!(key in changed)) this.#waiting.set(key, ["idle", "", null]);
    for (const key of Object.keys(changed)) this.#waiting.set(key, changed[key]);
    this.#paint();
  }

  /** Fold all blocks but the root, or none. */
  fold(folded) {
    for (const block of this.#blocks.values()) block.toggle(folded && block.parent !== null);
  }

  /** Make blocks, as many as there is time for, and the others before the next pictures of the screen. */
  #add() {
    const until = performance.now() + SHARE;
    while (this.#adding.length && performance.now() < until) {
      const [node, parent, list] = this.#adding.pop();
      const block = new Block(node, parent, list);
      parent?.children.push(block);
      this.#blocks.set(node.key, block);
      for (const [key, badge] of block.badges) this.#badges.set(key, badge);
      for (const child of node.children.toReversed()) this.#adding.push([child, block, block.inner]);
    }
    this.#stale = true;
    if (this.#adding.length) before_picture(this.#more);
    else this.#paint();
  }

  #patch() {
    if (this.#adding.length) return; // it is drawn once all blocks are there
    const now = performance.now();
    if (this.#stale) for (const block of this.#blocks.values()) if (block.texts.length) block.fill((name) => this.#value(name, block.scope));
    this.#stale = false;
    if (now - this.#ticked > TICKING) {
      this.#ticked = now;
      for (const block of this.#blocks.values()) if (isActive(block.status)) this.#due.add(block);
    }
    let left = this.#most;
    for (const block of [...this.#due].slice(0, left >> 2)) {
      left -= 1;
      this.#due.delete(block);
      block.tick(this.#t);
    }
    for (const [key, [status, reason, since]] of this.#waiting) {
      if (left-- <= 0) break;
      this.#waiting.delete(key);
      this.#now.set(key, status);
      const block = this.#blocks.get(key);
      if (block) {
        block.set(status, reason ?? "", since ?? null);
        block.tick(this.#t);
        if (this.follow) this.#scroll();
      } else if (this.#badges.has(key)) this.#badges.get(key).className = `badge ${status}`;
    }
    const visited = new Set(this.#visited);
    for (const [key, block] of this.#blocks) {
      if (block.visited !== visited.has(key)) block.item.classList.toggle("visited", (block.visited = !block.visited));
    }
    if (this.#waiting.size || this.#due.size) this.#paint();
    // What the browser makes of it costs more than this: that is known once the picture is drawn.
    setTimeout(() => (this.#most = performance.now() - now > LONGEST ? Math.max(FEWEST, this.#most >> 1) : Math.min(MOST, this.#most + 1)));
  }

  /** Scroll to the deepest node that runs, and unfold what is above it. */
  #reveal() {
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

  #roam(item) {
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
