"use strict";
/*
 * Works the tree of a page: fold, keyboard, search, layout and zoom, and the statuses of its nodes.
 *
 * A script that comes after it may use
 *   missiontree.data                  what document(..., data) was given, or null
 *   missiontree.showStates(states)    states[key] = [status, reason, age]: how each node and modifier stands; reason and
 *                                     age ("3.2 s", "3.2 s ago") may be left out; those that are not named are idle. It needs the
 *                                     tree of a drawing that has a time: at(drawing, {}, 0.0)
 *   missiontree.showNode(key)         unfold what hides a node, and go to it
 * and may listen to the event "node" of the document: the keyboard or the mouse is on another node, detail.key.
 */
const missiontree = (() => {
  const tree = document.querySelector('[role="tree"]');
  const view = tree.closest(".window");
  const items = [...tree.querySelectorAll('[role="treeitem"]')];
  const MANY = 60; // a tree of more nodes opens with its sub-missions folded
  const LEGIBLE = 0.75; // a tree that fits its window at no less than this zoom opens so
  const WIDE = "(min-width: 45rem)"; // where a tree is drawn from left to right at first

  const box = (item) => item.firstElementChild;
  const group = (item) => item.querySelector(':scope > [role="group"]');
  const parent = (item) => item.parentElement.closest('[role="treeitem"]');
  const hidden = (item) => item.parentElement.closest("[hidden]") !== null;
  const folded = (item) => item.getAttribute("aria-expanded") === "false";
  const words = (item) => box(item).textContent.toLowerCase();

  // Fold

  function fold(item, yes) {
    const below = group(item);
    if (!below || yes === folded(item)) return;
    item.setAttribute("aria-expanded", String(!yes));
    below.hidden = yes;
    if (yes && item !== entry && item.contains(entry)) enter(item, below.contains(document.activeElement));
  }

  function reveal(item) {
    for (let above = parent(item); above; above = parent(above)) fold(above, false);
  }

  for (const item of items) {
    const below = group(item);
    if (below) box(item).querySelector(".fold").dataset.count = below.querySelectorAll('[role="treeitem"], .badge').length;
  }

  // Move: one item at a time is where the keyboard enters the tree

  let entry = items[0];

  function enter(item, focus = true) {
    entry.tabIndex = -1;
    entry = item;
    entry.tabIndex = 0;
    if (focus) item.focus({ preventScroll: true });
    box(item).scrollIntoView({ block: "nearest", inline: "nearest" });
  }

  function goTo(item) {
    reveal(item);
    enter(item);
  }

  /** The item after (1) or before (-1) another one that fits; beyond the end the first, if it may go round. */
  function neighbour(item, step, fits, round = false) {
    const from = items.indexOf(item);
    for (let passed = 1; passed <= items.length; passed++) {
      const place = from + step * passed;
      if (!round && !items[place]) return null;
      const found = items[(place + items.length) % items.length];
      if (fits(found)) return found;
    }
    return null;
  }

  const visible = (item) => !hidden(item);
  const first = (item) => group(item)?.firstElementChild;
  const siblings = (item) => [...item.parentElement.children];

  const keys = {
    ArrowDown: (item) => neighbour(item, 1, visible),
    ArrowUp: (item) => neighbour(item, -1, visible),
    ArrowRight: (item) => (folded(item) ? fold(item, false) : first(item)),
    ArrowLeft: (item) => (group(item) && !folded(item) ? fold(item, true) : parent(item)),
    Home: () => items[0],
    End: () => items.findLast(visible),
    Enter: (item) => fold(item, !folded(item)),
    " ": (item) => fold(item, !folded(item)),
    "*": (item) => siblings(item).forEach((each) => fold(each, false)),
    "+": () => zoom("in"),
    "-": () => zoom("out"),
    0: () => zoom("none"),
  };

  let typed = "";
  let forget = 0;

  /** Type-ahead: the next item whose text begins with what was typed without a pause. */
  function begins(item, key) {
    clearTimeout(forget);
    forget = setTimeout(() => (typed = ""), 600);
    typed += key.toLowerCase();
    const fits = (each) => visible(each) && each.querySelector("b").textContent.toLowerCase().startsWith(typed);
    return typed.length > 1 && fits(item) ? item : neighbour(item, 1, fits, true);
  }

  tree.addEventListener("keydown", (event) => {
    const item = event.target;
    if (!items.includes(item) || event.ctrlKey || event.metaKey || event.altKey || event.key === "/") return;
    const move = keys[event.key] ?? (event.key.length === 1 ? (each) => begins(each, event.key) : null);
    if (!move) return;
    event.preventDefault();
    const next = move(item);
    if (next) enter(next);
  });

  tree.addEventListener("focusin", (event) => {
    if (event.target !== entry && items.includes(event.target)) enter(event.target);
    document.dispatchEvent(new CustomEvent("node", { detail: { key: entry.dataset.key } }));
  });

  tree.addEventListener("mousedown", (event) => {
    if (event.target.closest(".fold")) event.preventDefault(); // the mark folds; it does not move the keyboard
  });

  tree.addEventListener("click", (event) => {
    const item = event.target.closest(".fold")?.closest('[role="treeitem"]');
    if (item) fold(item, !folded(item));
  });

  // Search: every word must be somewhere in the text of a node

  const field = document.querySelector(".finder input");
  const count = document.querySelector(".finder .count");
  let hits = [];
  let hit = null;

  function search() {
    const wanted = field.value.toLowerCase().split(/\s+/).filter(Boolean);
    const found = (item) => wanted.length > 0 && wanted.every((word) => words(item).includes(word));
    hits = items.filter((item) => item.classList.toggle("hit", found(item)));
    mark(wanted);
    showHit(hits[0] ?? null);
  }

  function showHit(item) {
    hit?.removeAttribute("aria-current");
    hit = item;
    const number = hits.indexOf(item) + 1;
    count.textContent = number ? `${number} of ${hits.length}` : field.value.trim() ? "nothing found" : "";
    if (!item) return;
    item.setAttribute("aria-current", "true");
    reveal(item);
    enter(item, false);
  }

  /** Mark the words within the hits, where the browser can do so without a change of the page. */
  function mark(wanted) {
    if (!window.Highlight) return;
    const ranges = hits.flatMap((item) => [...texts(box(item))].flatMap((text) => wanted.flatMap((word) => within(text, word))));
    CSS.highlights.set("found", new Highlight(...ranges));
  }

  function* texts(element) {
    const walker = document.createTreeWalker(element, NodeFilter.SHOW_TEXT);
    while (walker.nextNode()) yield walker.currentNode;
  }

  function within(text, word) {
    const start = text.data.toLowerCase().indexOf(word);
    if (start < 0) return [];
    const range = new Range();
    range.setStart(text, start);
    range.setEnd(text, start + word.length);
    return [range];
  }

  field.addEventListener("input", search);
  field.addEventListener("keydown", (event) => {
    if (event.key === "Enter" && hits.length) {
      const place = hits.indexOf(hit) + (event.shiftKey ? -1 : 1);
      showHit(hits[(place + hits.length) % hits.length]);
    } else if (event.key === "ArrowDown" || event.key === "Escape") {
      enter(hit ?? entry);
    } else return;
    event.preventDefault();
  });

  document.addEventListener("keydown", (event) => {
    if (event.key !== "/" || event.ctrlKey || event.metaKey || event.altKey || event.target.closest("input, textarea")) return;
    event.preventDefault();
    field.select();
  });

  // Layout and zoom

  const layout = document.querySelector("[data-outline]");
  let scale = 1;

  function spread(yes) {
    tree.classList.toggle("spread", yes);
    tree.classList.toggle("outline", !yes);
    layout.setAttribute("aria-pressed", String(!yes));
  }

  /** The zoom at which the tree is as wide as its window, but no larger than it is. */
  function fit() {
    return Math.min(1, (0.99 * scale * view.clientWidth) / tree.getBoundingClientRect().width);
  }

  function zoom(how) {
    const wanted = { in: () => scale * 1.25, out: () => scale / 1.25, none: () => 1, fit }[how]();
    scale = Math.min(4, Math.max(0.2, wanted));
    tree.style.zoom = scale;
    box(entry).scrollIntoView({ block: "nearest", inline: "nearest" });
  }

  view.addEventListener("wheel", (event) => {
    if (!event.ctrlKey) return;
    event.preventDefault();
    zoom(event.deltaY < 0 ? "in" : "out");
  }, { passive: false });

  // Buttons

  const buttons = {
    fold: (what) => items.filter((item) => item.matches(what)).forEach((item) => fold(item, true)),
    unfold: () => items.forEach((item) => fold(item, false)),
    next: (what) => goTo(neighbour(entry, 1, (item) => item.matches(what), true) ?? entry),
    outline: () => spread(!tree.classList.contains("spread")),
    zoom,
  };

  document.querySelector(".tools").addEventListener("click", (event) => {
    const button = event.target.closest("button");
    for (const [name, value] of Object.entries(button?.dataset ?? {})) buttons[name]?.(value);
  });

  // Statuses

  const signs = JSON.parse(tree.dataset.signs);
  const keyed = [...tree.querySelectorAll("[data-key]")];

  function showStates(states) {
    for (const element of keyed) {
      const [status, reason = "", age = ""] = states[element.dataset.key] ?? ["idle"];
      element.dataset.status = status;
      const within = items.includes(element) ? box(element) : element;
      const say = (part, text) => {
        const place = within.querySelector(part);
        if (place.textContent !== text) place.textContent = text;
      };
      say(".sign", signs[status]);
      say(".word", status);
      say(".age", age && ` ${age}`);
      say(".reason", reason && ` ${reason}`);
    }
    for (const item of items) item.dataset.outer = (box(item).querySelector("[data-key]") ?? item).dataset.status;
  }

  function showNode(key) {
    const item = items.find((each) => each.dataset.key === key);
    if (item) goTo(item);
  }

  const data = document.getElementById("data");

  document.documentElement.classList.add("scripted");
  document.querySelector(".tools").hidden = false;
  if (layout) spread(matchMedia(WIDE).matches);
  if (items.length > MANY) document.querySelector("[data-fold]")?.click();
  if (layout && fit() >= LEGIBLE) zoom("fit");

  return { data: data && JSON.parse(data.textContent), showStates, showNode };
})();
