// Map: the world, the robot, its path, people and the points of the range finder.

import { el, on_frame } from "./dom.js";

const RADIUS = 0.18; // metres, of a Kobuki
const MAX_TRAIL_POINTS = 4000; // points
const TRAIL_STEP = 0.02; // metres from one point of the trail to the next
const MARGIN = 1.5; // metres around the content if there is no world

export class Plan extends HTMLElement {
  #canvas = el("canvas", { role: "img", "aria-label": "Map" });
  #image = el("img", { alt: "", hidden: true });
  #world = null;
  #world_name = "";
  #pose = null;
  #trail = [];
  #scan = [];
  #people = [];
  #draw = on_frame(() => this.#paint(), 100);

  connectedCallback() {
    if (!this.firstChild) this.append(this.#image, this.#canvas);
    new ResizeObserver(this.#draw).observe(this);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", this.#draw);
  }

  /** Load the plan of a world over `link` as the background. */
  async under(link, name) {
    if (name === this.#world_name) return;
    this.#world_name = name;
    this.#world = null;
    this.#image.hidden = true;
    this.#draw();
    if (!name) return;
    const world = await link.ask({ do: "world", name }).catch(() => null);
    if (!world || this.#world_name !== name) return;
    // As an image: scripts in it do not run, and it loads nothing.
    this.#image.src = `data:image/svg+xml,${encodeURIComponent(world.svg)}`;
    this.#image.hidden = false;
    this.#world = world;
    this.#draw();
  }

  /** Clear robot, path, people and scan. */
  clear() {
    this.#pose = null;
    this.#trail = [];
    this.#scan = [];
    this.#people = [];
    this.#draw();
  }

  show({ pose, scan, percept }) {
    if (!pose && !scan && !percept) return;
    if (pose) this.#move_robot(pose);
    if (scan) this.#scan = scan;
    if (percept) this.people(percept);
    this.#draw();
  }

  /** Show the whole path: points [x, y] in metres. */
  way(points) {
    this.#trail = points;
    this.#draw();
  }

  people(percept) {
    const [x, y] = this.#pose ?? [0, 0];
    const seen = [...(percept?.faces ?? []).map((each) => [each, "face"]), ...(percept?.things ?? []).map((each) => [each, "thing"])];
    this.#people = seen.filter(([each]) => each.distance > 0).map(([each, kind]) => ({
      x: x + each.distance * Math.cos(each.yaw),
      y: y + each.distance * Math.sin(each.yaw),
      name: each.name || kind,
    }));
  }

  #move_robot(pose) {
    this.#pose = pose;
    const last = this.#trail.at(-1);
    if (last && Math.hypot(pose[0] - last[0], pose[1] - last[1]) < TRAIL_STEP) return;
    this.#trail.push([pose[0], pose[1]]);
    if (this.#trail.length > MAX_TRAIL_POINTS) this.#trail = this.#trail.filter((_, at) => at % 2 === 0);
  }

  #view(width, height) {
    const world = this.#world;
    if (world) {
      const scale = Math.min(width / world.width, height / world.height);
      const [left, top] = [(width - world.width * scale) / 2, (height - world.height * scale) / 2];
      const turn = (world.heading * Math.PI) / 180;
      const [cos, sin] = [Math.cos(turn), Math.sin(turn)];
      const metre = world.metre * scale;
      const place = ([x, y]) => [left + world.x * scale + (x * cos - y * sin) * metre, top + world.y * scale - (x * sin + y * cos) * metre];
      return { place, metre };
    }
    const all = [...this.#trail, this.#pose ?? [0, 0], ...this.#people.map((each) => [each.x, each.y])];
    const [xs, ys] = [all.map((each) => each[0]), all.map((each) => each[1])];
    const [low, high] = [[Math.min(...xs) - MARGIN, Math.min(...ys) - MARGIN], [Math.max(...xs) + MARGIN, Math.max(...ys) + MARGIN]];
    const metre = Math.min(width / (high[0] - low[0]), height / (high[1] - low[1]));
    const [x0, y0] = [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2];
    return { place: ([x, y]) => [width / 2 + (x - x0) * metre, height / 2 - (y - y0) * metre], metre };
  }

  #paint() {
    const width = this.clientWidth;
    const ratio = this.#world ? this.#world.height / this.#world.width : 0.7;
    const height = Math.round(Math.min(width * ratio, 460));
    if (!width) return;
    const fine = Math.min(devicePixelRatio || 1, 2);
    const canvas = this.#canvas;
    if (canvas.width !== Math.round(width * fine) || canvas.height !== Math.round(height * fine)) {
      canvas.width = Math.round(width * fine);
      canvas.height = Math.round(height * fine);
      this.style.setProperty("--height", `${height}px`);
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(fine, 0, 0, fine, 0, 0);
    pen.clearRect(0, 0, width, height);
    const look = getComputedStyle(this);
    const colour = (name) => look.getPropertyValue(name);
    const { place, metre } = this.#view(width, height);
    if (!this.#world) this.#draw_grid(pen, place, metre, width, height, colour("--edge"));
    const [x, y, heading] = this.#pose ?? [0, 0, 0];
    pen.fillStyle = colour("--failure");
    for (const [ahead, left] of this.#scan) {
      const at = place([x + ahead * Math.cos(heading) - left * Math.sin(heading), y + ahead * Math.sin(heading) + left * Math.cos(heading)]);
      pen.fillRect(at[0] - 1, at[1] - 1, 2, 2);
    }
    pen.strokeStyle = colour("--running");
    pen.lineWidth = 2;
    pen.beginPath();
    for (const point of this.#trail) pen.lineTo(...place(point));
    pen.stroke();
    this.#draw_people(pen, place, metre, colour);
    if (this.#pose) this.#draw_robot(pen, place, metre, colour);
    const people = this.#people.length ? `; sees ${this.#people.map((each) => each.name).join(", ")}` : "";
    canvas.setAttribute("aria-label", this.#pose ? `Map: the robot is at ${x.toFixed(1)} m, ${y.toFixed(1)} m${people}` : "Map");
  }

  #draw_grid(pen, place, metre, width, height, colour) {
    pen.strokeStyle = colour;
    pen.lineWidth = 1;
    const [x0, y0] = place([0, 0]);
    pen.beginPath();
    for (let x = x0 % metre; x < width; x += metre) (pen.moveTo(x, 0), pen.lineTo(x, height));
    for (let y = y0 % metre; y < height; y += metre) (pen.moveTo(0, y), pen.lineTo(width, y));
    pen.stroke();
  }

  #draw_people(pen, place, metre, colour) {
    pen.font = "12px system-ui, sans-serif";
    pen.textAlign = "center";
    for (const { x, y, name } of this.#people) {
      const at = place([x, y]);
      pen.fillStyle = colour("--people");
      pen.beginPath();
      pen.arc(...at, Math.max(5, 0.2 * metre), 0, 7);
      pen.fill();
      pen.lineWidth = 3;
      pen.strokeStyle = colour("--surface");
      pen.strokeText(name, at[0], at[1] - 0.25 * metre - 4);
      pen.fillStyle = colour("--ink");
      pen.fillText(name, at[0], at[1] - 0.25 * metre - 4);
    }
  }

  #draw_robot(pen, place, metre, colour) {
    const [x, y, heading] = this.#pose;
    const [at, nose] = [place([x, y]), place([x + RADIUS * Math.cos(heading), y + RADIUS * Math.sin(heading)])];
    const size = Math.max(7, RADIUS * metre);
    const angle = Math.atan2(nose[1] - at[1], nose[0] - at[0]);
    pen.fillStyle = colour("--running");
    pen.strokeStyle = colour("--surface");
    pen.lineWidth = 2;
    pen.beginPath();
    pen.arc(...at, size, 0, 7);
    pen.fill();
    pen.stroke();
    pen.beginPath();
    pen.moveTo(...at);
    pen.lineTo(at[0] + size * Math.cos(angle), at[1] + size * Math.sin(angle));
    pen.stroke();
  }
}

customElements.define("studio-plan", Plan);
