// Camera pictures with boxes around the detections; requested only while they are visible.

import { button, el, put } from "./dom.js";

const COLOURS = { face: "#ffb000", thing: "#5ac8fa", marker: "#8ee28e" };

/** Decode the base64 JPEG of a `picture` message. */
export async function decode(jpeg) {
  const text = atob(jpeg);
  const data = new Uint8Array(text.length);
  for (let at = 0; at < text.length; at++) data[at] = text.charCodeAt(at);
  return createImageBitmap(new Blob([data], { type: "image/jpeg" }));
}

/** Draw a picture with a named box around each detection. */
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

/** Return the detections of a picture as a caption. */
export function found(picture) {
  const names = (picture.found ?? []).map((each) => (each.name ? `${each.kind} ${each.name}` : each.kind));
  return names.length ? `sees ${names.join(", ")}` : "no detections";
}

export class Camera extends HTMLElement {
  #canvas = el("canvas", { width: 640, height: 480, role: "img", "aria-label": "Camera" });
  #caption = el("p", { class: "caption" });
  #watcher = null;
  #is_view_shown = false;
  #is_visible = false; // the canvas is scrolled into view
  #is_on = true; // switched by the user
  #is_busy = false;
  #described_at = 0;

  connectedCallback() {
    if (this.firstChild) return;
    const off = button("Camera off", () => {
      this.#is_on = !this.#is_on;
      put(off, this.#is_on ? "Camera off" : "Camera on");
      this.#update_rate();
    }, { class: "small" });
    this.append(this.#canvas, el("div", { class: "under" }, this.#caption, off));
    new IntersectionObserver(([entry]) => {
      this.#is_visible = entry.isIntersecting;
      this.#update_rate();
    }).observe(this.#canvas);
  }

  begin(watcher, rate = 10) {
    this.#watcher = watcher;
    this.rate = rate;
    watcher.addEventListener("picture", ({ detail }) => this.#show_picture(detail));
    watcher.addEventListener("which", () => this.#clear());
  }

  set shown(shown) {
    this.#is_view_shown = shown;
    this.#update_rate();
    if (shown && this.#watcher?.picture) this.#show_picture(this.#watcher.picture); // the next picture may take long
  }

  #update_rate() {
    this.#watcher?.look(this, this.#is_view_shown && this.#is_visible && this.#is_on ? this.rate : 0);
  }

  #clear() {
    this.#canvas.getContext("2d").clearRect(0, 0, this.#canvas.width, this.#canvas.height);
    put(this.#caption, "");
  }

  async #show_picture(picture) {
    if (!this.#is_view_shown || this.#is_busy) return;
    this.#is_busy = true;
    try {
      await paint(this.#canvas, picture);
    } catch {
      put(this.#caption, "unreadable picture");
    } finally {
      this.#is_busy = false;
      if (this.#watcher.lives) this.#watcher.send("seen", { t: picture.t });
    }
    put(this.#caption, found(picture));
    if (performance.now() - this.#described_at < 1000) return;
    this.#described_at = performance.now();
    this.#canvas.setAttribute("aria-label", `Camera: ${this.#caption.textContent}`);
  }
}

customElements.define("studio-camera", Camera);
