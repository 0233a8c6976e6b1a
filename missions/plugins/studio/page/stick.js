// A stick for a thumb or the mouse: it springs back when it is released, or when its pointer is lost.

import { el } from "./dom.js";

const DEAD_ZONE = 0.08; // share of the travel without effect

export class Stick extends HTMLElement {
  /** Deflection to the left and upwards, from -1 to 1. */
  left = 0;
  up = 0;
  #knob = el("span", { class: "knob" });
  #pointer = null;

  connectedCallback() {
    if (this.firstChild) return;
    this.append(this.#knob);
    this.addEventListener("pointerdown", (event) => {
      if (this.#pointer !== null || this.hasAttribute("disabled")) return;
      this.#pointer = event.pointerId;
      this.setPointerCapture(event.pointerId);
      this.#move(event);
    });
    this.addEventListener("pointermove", (event) => event.pointerId === this.#pointer && this.#move(event));
    for (const type of ["pointerup", "pointercancel", "lostpointercapture"]) {
      this.addEventListener(type, (event) => event.pointerId === this.#pointer && this.release());
    }
    this.addEventListener("contextmenu", (event) => event.preventDefault());
  }

  /** Return to the centre. */
  release() {
    this.#pointer = null;
    this.left = this.up = 0;
    this.#show(0, 0);
    this.dispatchEvent(new Event("push"));
  }

  #move(event) {
    const box = this.getBoundingClientRect();
    const reach = box.width / 2 - 24;
    let [x, y] = [(event.clientX - box.left - box.width / 2) / reach, (event.clientY - box.top - box.height / 2) / reach];
    const far = Math.hypot(x, y);
    if (far > 1) [x, y] = [x / far, y / far];
    this.#show(x * reach, y * reach);
    const share = (value) => (Math.abs(value) < DEAD_ZONE ? 0 : Math.sign(value) * ((Math.abs(value) - DEAD_ZONE) / (1 - DEAD_ZONE)));
    this.left = -share(x) || 0;
    this.up = -share(y) || 0;
    this.dispatchEvent(new Event("push"));
  }

  #show(x, y) {
    this.#knob.style.transform = `translate(${x}px, ${y}px)`;
    this.classList.toggle("held", this.#pointer !== null);
  }
}

customElements.define("studio-stick", Stick);
