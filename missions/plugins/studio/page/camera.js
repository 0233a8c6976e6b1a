// The camera's pictures with what was found in them, while somebody looks.

import { button, el, put } from "./dom.js";

const COLOURS = { face: "#ffb000", thing: "#5ac8fa", marker: "#8ee28e" };

/** Decode a picture of the protocol. */
export async function decode(jpeg) {
  const text = atob(jpeg);
  const data = new Uint8Array(text.length);
  for (let at = 0; at < text.length; at++) data[at] = text.charCodeAt(at);
  return createImageBitmap(new Blob([data], { type: "image/jpeg" }));
}

/** Draw a picture, and boxes with names around what was found in it. */
export async function paint(canvas, picture) {
  const image = await decode(picture.jpeg);
  if (canvas.width !== picture.width || canvas.height !== picture.height) {
    canvas.width = picture.width;
    canvas.height = picture.height;
  }
  const pen = canvas.getContext("2d");
  pen.drawImage(image, 0, 0, canvas.width, canvas.height);
  image.close();
  const size = Math.max(12, Math.round(picture.width / 32));
  pen.font = `600 ${size}px system-ui, sans-serif`;
  pen.textBaseline = "bottom";
  for (const { kind, name, box } of picture.found ?? []) {
    const [x, y, width, height] = box;
    const text = name || kind || "";
    pen.lineWidth = Math.max(2, picture.width / 240);
    pen.strokeStyle = COLOURS[kind] ?? COLOURS.thing;
    pen.strokeRect(x, y, width, height);
    const wide = pen.measureText(text).width + 10;
    const top = y - size - 6 < 0 ? y + height : y - size - 6;
    pen.fillStyle = pen.strokeStyle;
    pen.fillRect(x - pen.lineWidth / 2, top, wide, size + 6);
    pen.fillStyle = "#10151a";
    pen.fillText(text, x + 5, top + size + 4);
  }
}

/** Say in words what was found. */
export function found(picture) {
  const names = (picture.found ?? []).map((each) => (each.name ? `${each.kind} ${each.name}` : each.kind));
  return names.length ? `sees ${names.join(", ")}` : "no detections";
}

export class Camera extends HTMLElement {
  #canvas = el("canvas", { width: 640, height: 480, role: "img", "aria-label": "Camera" });
  #said = el("p", { class: "caption" });
  #watcher = null;
  #shown = false; // the view
  #seen = false; // this place of it
  #on = true; // by the person's wish
  #busy = false;
  #worded = 0;

  connectedCallback() {
    if (this.firstChild) return;
    const off = button("Camera off", () => {
      this.#on = !this.#on;
      put(off, this.#on ? "Camera off" : "Camera on");
      this.#look();
    }, { class: "small" });
    this.append(this.#canvas, el("div", { class: "under" }, this.#said, off));
    new IntersectionObserver(([entry]) => {
      this.#seen = entry.isIntersecting;
      this.#look();
    }).observe(this.#canvas);
  }

  /** Show the pictures of a watcher, up to `rate` a second. */
  begin(watcher, rate = 10) {
    this.#watcher = watcher;
    this.rate = rate;
    watcher.addEventListener("picture", ({ detail }) => this.#take(detail));
    watcher.addEventListener("which", () => this.#clear());
  }

  /** The view is shown, or not any more. */
  set shown(shown) {
    this.#shown = shown;
    this.#look();
    if (shown && this.#watcher?.picture) this.#take(this.#watcher.picture); // the next one may be long in coming
  }

  #look() {
    this.#watcher?.look(this, this.#shown && this.#seen && this.#on ? this.rate : 0);
  }

  #clear() {
    this.#canvas.getContext("2d").clearRect(0, 0, this.#canvas.width, this.#canvas.height);
    put(this.#said, "");
  }

  async #take(picture) {
    if (!this.#shown || this.#busy) return;
    this.#busy = true;
    try {
      await paint(this.#canvas, picture);
    } catch {
      put(this.#said, "unreadable picture");
    } finally {
      this.#busy = false;
      if (this.#watcher.lives) this.#watcher.send("seen", { t: picture.t });
    }
    if (performance.now() - this.#worded < 1000) return;
    this.#worded = performance.now();
    put(this.#said, found(picture));
    this.#canvas.setAttribute("aria-label", `Camera: ${this.#said.textContent}`);
  }
}

customElements.define("studio-camera", Camera);
