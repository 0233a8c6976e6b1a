// Helpers that make elements. Text from the connection is untrusted: it only ever becomes text nodes.

const FOLDED_PANELS = ["later", "preview", "who"]; // panels that are folded at first
const REDRAW_FACTOR = 3; // wait this many times the duration of a drawing before the next one
export const FRAME_BUDGET = 12; // milliseconds of script in a frame; the rest waits for the next frame
const SVG = "http://www.w3.org/2000/svg";

/** Return an element with attributes (properties if the value is not a text), listeners ("onclick") and children. */
export function el(tag, props, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(props ?? {})) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (typeof value !== "string" && typeof value !== "number" && value !== true) node[name] = value;
    else node.setAttribute(name, value === true ? "" : value);
  }
  node.append(...children.flat().filter((each) => each !== null && each !== undefined && each !== false));
  return node;
}

/** Return an SVG element. */
export function svg(tag, attributes, ...children) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes ?? {})) node.setAttribute(name, value);
  node.append(...children);
  return node;
}

/** Set the text of an element if it has changed. */
export function put(node, text) {
  if (node.textContent !== text) node.textContent = text;
}

/** Set the children of a list. Kept children are not moved, so they keep the focus and the scroll position. */
export function arrange(list, nodes) {
  const wanted = new Set(nodes);
  for (const old of [...list.children]) if (!wanted.has(old)) old.remove();
  let next = list.firstChild;
  for (const node of nodes) {
    if (node === next) next = next.nextSibling;
    else list.insertBefore(node, next);
  }
}

/** Return a button; `more` has further attributes. */
export function button(text, onclick, more) {
  return el("button", { type: "button", onclick, ...more }, text);
}

export function field(label, control, help = "") {
  const id = `field-${(field.count = (field.count ?? 0) + 1)}`;
  control.id = id;
  const hint = help && el("span", { class: "hint", id: `${id}-hint` }, help);
  if (help) control.setAttribute("aria-describedby", `${id}-hint`);
  return el("div", { class: "field" }, el("label", { for: id }, label), control, hint);
}

export function choice(options, value = "") {
  const select = el("select");
  for (const option of options) {
    const [held, text] = Array.isArray(option) ? option : [option, option];
    select.append(el("option", { value: held, selected: held === value ? true : false }, text));
  }
  return select;
}

export function set_options(select, options) {
  const { value } = select;
  select.replaceChildren(...choice(options).children);
  if (options.some((option) => (Array.isArray(option) ? option[0] : option) === value)) select.value = value;
}

/** Return a switch: a button that is on or off. Not a check box, because the space bar is STOP. */
export function toggle(text, on, changed) {
  const node = button(text, () => {
    const now = node.getAttribute("aria-checked") !== "true";
    node.setAttribute("aria-checked", String(now));
    changed?.(now);
  }, { role: "switch", class: "switch", "aria-checked": String(on) });
  return node;
}

/** Return a panel with a heading that folds it; the state is stored under `key`. */
export function panel(title, key, ...children) {
  const body = el("div", { class: "body" }, ...children);
  const node = el("section", { class: `panel ${key}`, "aria-label": title });
  const folded = () => node.classList.contains("folded");
  const head = button(title, () => {
    node.classList.toggle("folded");
    head.setAttribute("aria-expanded", String(!folded()));
    localStorage.setItem(`folded ${key}`, folded() ? "1" : "");
    node.dispatchEvent(new Event("fold"));
  }, { class: "fold-panel" });
  if (localStorage.getItem(`folded ${key}`) ?? FOLDED_PANELS.includes(key)) node.classList.add("folded");
  head.setAttribute("aria-expanded", String(!folded()));
  node.append(el("h2", null, head), body);
  node.body = body;
  return node;
}

/**
* Return a function that schedules `work` before the next frame, once, however often it is called: at once after a
* pause, else every `every` milliseconds, and less often if drawing takes too large a share of the time.
 */
export function on_frame(work, every = 0) {
  let waiting = false;
  let next = 0;
  const drawn = () => {
    const began = performance.now();
    waiting = false;
    work();
    // A timeout set in a frame runs after drawing, so this measures it too.
    setTimeout(() => (next = began + Math.max(every, REDRAW_FACTOR * (performance.now() - began))));
  };
  return () => {
    if (waiting) return;
    waiting = true;
    const rest = next - performance.now();
    if (rest > 0) setTimeout(() => before_frame(drawn), rest);
    else before_frame(drawn);
  };
}

const frame_works = new Set(); // work for the next frames
let is_frame_requested = false;

/** Run `work` before the next frame, or before a later one if the frame's budget is used up. */
export function before_frame(work) {
  frame_works.add(work);
  if (!is_frame_requested) requestAnimationFrame(run_frame_works);
  is_frame_requested = true;
}

function run_frame_works() {
  const until = performance.now() + FRAME_BUDGET;
  for (const work of frame_works) {
    frame_works.delete(work);
    work();
    if (performance.now() > until) break;
  }
  is_frame_requested = frame_works.size > 0;
  if (is_frame_requested) requestAnimationFrame(run_frame_works);
}

/** Return a button for an action that cannot be undone: `work` runs at the second press. */
export function confirm_button(text, again, work, more) {
  const armed = () => node.classList.contains("armed");
  const node = button(text, () => {
    if (armed()) work();
    node.classList.toggle("armed");
    put(node, armed() ? again : text);
  }, more);
  return node;
}

const notes = document.getElementById("notes");

/** Show a notification: a protocol error with its hint, or a text; `action` is a button for the next step. */
export function notify(what, kind = "bad", action = null) {
  const text = typeof what === "string" ? what : what.message;
  const hint = typeof what === "string" ? "" : what.hint;
  const node = el("div", { class: `note ${kind}` }, el("span", null, text, hint && el("em", null, `\nTry: ${hint}`)));
  if (action) node.append(action);
  action?.addEventListener("click", () => node.remove());
  node.append(button("×", () => node.remove(), { "aria-label": "Dismiss" }));
  for (const old of notes.children) if (old.textContent === node.textContent) return;
  while (notes.children.length > 2) notes.firstChild.remove();
  notes.append(node);
  setTimeout(() => node.remove(), kind === "bad" || action ? 15000 + 60 * text.length : 6000); // a long text takes longer to read
}
