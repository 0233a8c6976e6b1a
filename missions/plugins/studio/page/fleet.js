// Fleet: its robots, the mission of each, and a stop for all.

import { button, el, panel, put, notify } from "./dom.js";
import "./tree.js";
import { plain } from "./words.js";

const REPLY_TIMEOUT = 10000; // milliseconds for all robots to reply, retries included
const REFRESH_INTERVAL = 1000; // milliseconds between refreshes

export class Fleet {
  #link;
  #timer = 0;
  #message = el("p", { class: "hint", role: "status" });
  #list = el("ul", { class: "task-list" });
  #tools = el("div", { class: "tools" });
  #plan = el("div", { class: "fleet-plan" });
  #drawn_text = "";

  constructor({ link }) {
    this.#link = link;
    this.node = el("div", { class: "view fleet" }, panel("Fleet", "fleet", this.#tools, this.#message, this.#list, this.#plan));
  }

  show() {
    clearInterval(this.#timer);
    this.#timer = setInterval(() => document.hidden || this.#fetch(), REFRESH_INTERVAL);
    const may = this.#link.welcome?.role === "operator";
    this.#tools.replaceChildren(
      button("Stop the fleet", () => this.#do("stop_fleet"), { class: "danger" }),
      ...(may ? [button("Release all", () => this.#do("release_fleet"))] : []));
    this.#fetch();
  }

  hide() {
    clearInterval(this.#timer);
  }

  async #fetch() {
    if (!this.#link.open) return;
    try {
      const { fleet, robots, missing } = await this.#link.ask({ do: "fleet" });
      const text = JSON.stringify([robots.map((each) => ({ ...each, age: 0 })), missing]);
      if (text === this.#drawn_text) return; // unchanged: keep the focus
      put(this.#message, robots.length ? `Fleet ${fleet}: ${robots.length} robot${robots.length > 1 ? "s" : ""}` : `No robots in fleet ${fleet}. Try: mission task serve --fleet ${fleet}`);
      this.#list.replaceChildren(...robots.map((robot) => this.#row(robot)), ...missing.map((name) => this.#row({ name, connection: "OFFLINE" })));
      this.#drawn_text = text; // only after it was drawn, so that a failed drawing is repeated
    } catch (error) {
      put(this.#message, [error.message, error.hint && `Try: ${error.hint}`].filter(Boolean).join("\n"));
    }
  }

  #row(robot) {
    const may = this.#link.welcome?.role === "operator";
    const facts = [
      robot.robot && plain(robot.robot),
      robot.simulated && "simulated",
      robot.mission && plain(robot.mission),
      robot.task_state,
      typeof robot.battery === "number" && `battery ${Math.round(robot.battery * 100)} %`,
      typeof robot.x === "number" && typeof robot.y === "number" && `at ${robot.x.toFixed(1)} m, ${robot.y.toFixed(1)} m`,
      robot.free && "free",
    ];
    return el("li", { class: `task ${robot.connection === "ONLINE" ? "running" : "failed"}` },
      el("div", null, el("b", null, robot.name), el("span", { class: "outcome" }, robot.stopped ? "STOPPED" : robot.connection),
        el("span", { class: "facts" }, facts.filter(Boolean).join(" · ")), robot.stopped && el("span", { class: "reason" }, `stopped by ${robot.stopped}`)),
      el("div", { class: "actions" },
        robot.mission && button("Tree", () => this.#show(robot), { "aria-label": `Tree of ${robot.name}` }),
        may && robot.stopped && button("Release", () => this.#do("release_fleet", { robot: `${robot.name}/${robot.number}` }), { "aria-label": `Release ${robot.name}` })));
  }

  async #show(robot) {
    try {
      const mission = await this.#link.ask({ do: "mission", name: robot.mission });
      const tree = el("studio-tree", { class: "preview" });
      tree.draw(mission.drawing, mission.first);
      this.#plan.replaceChildren(el("h3", null, `${plain(robot.mission)} on ${robot.name}`), tree);
    } catch (error) {
      notify(error);
    }
  }

  async #do(word, members = {}) {
    try {
      const { answers, silent = [] } = await this.#link.ask({ do: word, ...members }, REPLY_TIMEOUT);
      const wrong = Object.entries(answers).filter(([, each]) => !each.ok).map(([name, each]) => `${name}: ${each.why}`);
      const all = [...silent.map((name) => `${name} did not confirm and may still move: press its emergency stop`), ...wrong];
      if (all.length) notify(all.join("; "));
      else if (!Object.keys(answers).length) notify("No connected robots in this fleet: none was reached. To stop a robot, press its emergency stop.");
      else notify(`All ${Object.keys(answers).length} robots confirmed.`, "good");
      await this.#fetch();
    } catch (error) {
      notify(error);
    }
  }
}
