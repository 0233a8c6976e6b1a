// Tasks: the queue.

import { button, el, panel, put, notify, toggle, confirm_button } from "./dom.js";
import { day, plain } from "./words.js";

const REFRESH_INTERVAL = 3000; // milliseconds between refreshes

export class Tasks {
  #link;
  #with_ended = false;
  #timer = 0;
  #server_message = el("p", { class: "hint", role: "status" });
  #list = el("ul", { class: "task-list" });
  #drawn_text = "";

  constructor({ link }) {
    this.#link = link;
    const all = toggle("Show ended tasks", false, (on) => {
      this.#with_ended = on;
      this.#fetch();
    });
    this.node = el("div", { class: "view tasks" },
      panel("Tasks", "tasks", el("div", { class: "tools" }, all, el("a", { class: "button", href: "#run" }, "Add a task")), this.#server_message, this.#list));
  }

  show() {
    clearInterval(this.#timer);
    this.#timer = setInterval(() => document.hidden || this.#fetch(), REFRESH_INTERVAL);
    this.#fetch();
  }

  hide() {
    clearInterval(this.#timer);
  }

  async #fetch() {
    if (!this.#link.open) return;
    try {
      const { tasks, served } = await this.#link.ask({ do: "tasks", ended: this.#with_ended });
      put(this.#server_message, served ? "" : "No task server is running. Try: mission task serve");
      const text = JSON.stringify(tasks);
      if (text === this.#drawn_text) return; // unchanged: keep the focus
      this.#drawn_text = text;
      this.#list.replaceChildren(...(tasks.length ? tasks.map((task) => this.#row(task)) : [el("li", { class: "empty" }, "The queue is empty.")]));
    } catch (error) {
      notify(error);
    }
  }

  #row(task) {
    const may = this.#link.welcome?.role === "operator";
    const waits = task.state === "waiting";
    const name = plain(task.mission.split("/").at(-1).replace(/\.yaml$/, ""));
    const params = Object.entries(task.params).map(([key, value]) => `${plain(key)}: ${value}`);
    const when = task.due ? `at ${day(task.due)}` : "when its turn comes";
    const facts = [
      task.robot ? plain(task.robot) : "simulated",
      waits && when,
      task.every && `every ${task.every}`,
      `priority ${task.priority}`,
      task.approved_by && `approved by ${task.approved_by}`,
      task.attempts > 1 && `${task.attempts} attempts`,
      ...params,
    ];
    const move = (by, sign, label) => button(sign, () => {
      this.#do("move_task", task.id, { priority: Math.max(-100, Math.min(100, task.priority + by)) });
    }, { "aria-label": `${label} priority of task ${task.id}` });
    const cancel = confirm_button("Cancel", "Press again to cancel the task", () => this.#do("cancel_task", task.id), { class: "danger" });
    const unapproved = waits && task.needs_approval && task.approved === null;
    const approve = unapproved && confirm_button("Approve", "Press again to approve", () => this.#do("approve_task", task.id), { class: "main" });
    return el("li", { class: `task ${task.state}` },
      el("div", null, el("b", null, `${task.id}  ${name}`), el("span", { class: "outcome" }, unapproved ? "needs approval" : plain(task.state)),
        el("span", { class: "facts" }, facts.filter(Boolean).join(" · ")), task.reason && el("span", { class: "reason" }, task.reason)),
      may && (waits || task.state === "running") && el("div", { class: "actions" }, approve, waits && [move(1, "Priority ↑", "Raise"), move(-1, "Priority ↓", "Lower")], cancel));
  }

  async #do(word, task, members) {
    try {
      await this.#link.ask({ do: word, task, ...members });
      await this.#fetch();
    } catch (error) {
      notify(error);
    }
  }
}
