// Run: the missions, and the form that starts one.

import { arrange, button, el, field, panel, put, notify, toggle } from "./dom.js";
import { Params, Target } from "./form.js";
import { links } from "./links.js";
import { pose } from "./pose.js";
import { sketch } from "./sketch.js";
import { heading, plain } from "./words.js";
import "./tree.js";

const REFRESH_INTERVAL = 3000; // milliseconds between checks for changed files

export class Run {
  #link;
  #watcher;
  #library = null;
  #target = null;
  #mission = null;
  #chosen = "";
  #edition = ""; // of the chosen mission's file
  #params = null;
  #items = new Map(); // list items by name: entry and element
  #timer = 0;
  #trouble = el("p", { class: "trouble", role: "alert" });
  #search = el("input", { type: "search", placeholder: "Search missions", "aria-label": "Search missions" });
  #list = el("ul", { class: "missions" });
  #own_heading = el("li", { class: "group" }, "Your missions");
  #shipped_heading = el("li", { class: "group" }, "Shipped with MissionTree");
  #hint = el("p", { class: "hint" });
  #queue_button = button("Add to the queue", () => this.#queue());
  #motions = el("div", { class: "motions", role: "group", "aria-label": "Course exercises" });
  #people = el("p", { class: "hint" });
  #person = el("input", { type: "text", autocomplete: "off" });
  #add_from_run = button("Add with the robot's camera", () => this.#add_person(false));
  #add_here = button("Add with this browser's camera", () => this.#add_person(true));
  #preview = el("div", { class: "pose" });
  #person_form = el("div", { hidden: true }, field("Name", this.#person, "of the person in front of the camera; ask them first"), el("div", { class: "actions" }, this.#add_from_run, this.#add_here), this.#preview);
  #checkup = el("div", { class: "hint" });
  #form = el("div", { class: "chosen" }, el("p", { class: "empty" }, "Loading the missions…"));
  #links = el("div", { hidden: true });
  #approval = toggle("Needs approval before it begins", false);
  #run_button = button("Run", () => this.#start(), { class: "main" });
  #when = {
    at: el("input", { type: "text", placeholder: "now" }),
    every: el("input", { type: "text", placeholder: "once" }),
    priority: el("input", { type: "text", inputmode: "numeric", value: "0" }),
    retry: el("input", { type: "text", inputmode: "numeric", value: "0" }),
  };

  get #may() {
    return this.#link.welcome?.role === "operator";
  }

  constructor({ link, watcher, stop }) {
    this.#link = link;
    this.#watcher = watcher;
    this.#links.append(links(link, stop));
    this.#search.addEventListener("input", () => this.#filter());
    const library = panel("Missions", "missions", this.#search, this.#trouble, this.#list);
    this.node = el("div", { class: "view run" },
      el("div", { class: "side" }, panel("Course exercises", "eight", this.#hint, this.#motions), library, panel("People", "people", this.#people, this.#person_form),
        panel("Diagnostics", "checkup", this.#checkup), this.#links),
      this.#form);
  }

  async show(name) {
    this.#links.hidden = this.#person_form.hidden = !this.#may;
    put(this.#hint, this.#may ? "A press starts one, simulated." : "Viewers cannot start missions.");
    this.#enable();
    clearInterval(this.#timer);
    this.#timer = setInterval(() => document.hidden || this.#refresh(), REFRESH_INTERVAL);
    try {
      await this.#fetch();
    } catch (error) {
      notify(error);
      if (!this.#library) return this.#form.replaceChildren();
    }
    this.node.classList.toggle("has-chosen", Boolean(name));
    if (name) await this.#choose(name);
    else if (!this.#chosen) this.#form.replaceChildren(el("p", { class: "empty" }, "Choose a mission."));
  }

  hide() {
    clearInterval(this.#timer);
  }

  async #refresh() {
    if (!this.#library || !this.#link.open) return;
    try {
      if ((await this.#fetch()) && this.#chosen) await this.#choose(this.#chosen);
    } catch (error) {
      if (error.error !== "lost") notify(error);
    }
  }

  async #fetch() {
    const library = await this.#link.library(this.#library?.edition);
    if (!library.missions) return false;
    this.#library = library;
    if (this.#target) this.#target.update(library);
    else {
      this.#target = new Target(library);
      this.#target.node.addEventListener("change", () => this.#show_target());
      this.#motions.replaceChildren(...library.motions.map((name, at) => {
        const node = button("", () => this.#start_motion(name));
        node.append(el("b", null, String(at + 1)), el("span", null, plain(name.split("/").at(-1))));
        return node;
      }));
      this.#enable();
    }
    this.#arrange(library.missions);
    put(this.#trouble, library.trouble);
    put(this.#people, library.people.length ? `The robot knows ${library.people.join(", ")}.` : "The robot knows no people yet. Try: mission person add NAME");
    this.#checkup.replaceChildren(...checkup_lines(library.checkup));
    return true;
  }

  #arrange(missions) {
    const own = missions.findIndex((each) => !each.own);
    const items = new Map(missions.map((entry) => {
      const text = JSON.stringify(entry);
      const old = this.#items.get(entry.name);
      return [entry.name, old?.text === text ? old : { text, entry, node: item(entry) }];
    }));
    this.#items = items;
    const nodes = [...items.values()].map(({ node }) => node);
    if (own > 0) nodes.splice(own, 0, this.#shipped_heading);
    arrange(this.#list, own > 0 ? [this.#own_heading, ...nodes] : nodes);
    this.#filter();
  }

  /** Add the person in front of this browser's camera (`here`), or of the shown run's camera. */
  async #add_person(here) {
    const name = this.#person.value.trim();
    this.#add_from_run.disabled = this.#add_here.disabled = true;
    try {
      if (!name) throw new Error("Enter a name first.");
      if (!here && !this.#watcher.lives) throw new Error("The robot's camera needs a run: start one, such as Drive without a mission.");
      if (!here) notify("Look into the robot's camera; turn your head a little to each side…", "good");
      else await pose(this.#preview, (words) => notify(words, "good"), (jpeg) => this.#link.ask({ do: "show_person", jpeg }));
      const { message } = await this.#link.ask({ do: "add_person", name, run: here ? "" : this.#watcher.run }, 70000);
      notify(message, "good");
      await this.#refresh();
    } catch (error) {
      notify(error);
    } finally {
      this.#add_from_run.disabled = this.#add_here.disabled = false;
    }
  }

  #filter() {
    const words = this.#search.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const each of this.#list.children) each.hidden = !words.every((word) => (each.dataset.words ?? "").includes(word));
  }

  async #choose(name) {
    const edition = this.#items.get(name)?.text ?? "";
    if (this.#chosen === name && this.#edition === edition) return;
    const former = this.#chosen === name ? this.#params : null;
    this.#chosen = name;
    this.#edition = edition;
    this.#params = this.#mission = null;
    let mission;
    try {
      mission = await this.#link.ask({ do: "mission", name });
    } catch (error) {
      if (this.#chosen === name) this.#form.replaceChildren(el("p", { class: "back" }, el("a", { href: "#run" }, "‹ all missions")), el("p", { class: "trouble", role: "alert" }, error.message, error.hint && `\nTry: ${error.hint}`));
      return;
    }
    if (this.#chosen !== name) return; // another choice was made in the meantime
    this.#mission = mission;
    const params = (this.#params = new Params(mission.params, this.#library.people));
    if (former) params.keep(former);
    const tree = el("studio-tree", { class: "preview" });
    tree.draw(mission.drawing, mission.first);
    const show_values = () => tree.values(params.texts, true);
    params.node.addEventListener("input", show_values);
    params.node.addEventListener("click", show_values); // switches are buttons
    show_values();
    const { at, every, priority, retry } = this.#when;
    this.#form.replaceChildren(
      el("p", { class: "back" }, el("a", { href: "#run" }, "‹ all missions")),
      el("h1", null, plain(mission.title)),
      el("p", { class: "summary" }, mission.summary),
      panel("Parameters", "params", params.node),
      panel("Where it runs", "target", this.#target.node),
      el("div", { class: "actions" }, this.#run_button),
      panel("Schedule", "later",
        el("div", { class: "fields two" }, field("At", at, "18:00, or 2026-12-24 18:00"), field("Every", every, "30 min, day, monday 18:00"),
          field("Priority", priority, "-100 to 100, the highest runs first"), field("Retries", retry, "after a failure")),
        this.#approval,
        this.#queue_button),
      panel("Tree", "preview", tree));
    this.#show_target();
  }

  #show_target() {
    const real = this.#target.real;
    put(this.#run_button, real ? "Run on the robot" : "Run simulated");
    this.#run_button.classList.toggle("real", real);
  }

  /** Start a simulated motion at once; on a robot, open its form, which asks for confirmation. */
  #start_motion(name) {
    if (this.#target.real) location.hash = `#run/${encodeURIComponent(name)}`;
    else this.#launch(name, {});
  }

  #start() {
    try {
      this.#launch(this.#mission.name, this.#params.values);
    } catch (error) {
      notify(error.message);
    }
  }

  async #launch(mission, params) {
    try {
      const members = this.#target.members();
      this.#enable(false);
      notify(`Starting ${plain(mission)}…`, "good");
      const { run, message } = await this.#link.ask({ do: "start", mission, params, ...members }, 60000);
      if (message) notify(message);
      this.#target.reset_confirmation();
      this.#watcher.follow(run);
      location.hash = "#live";
    } catch (error) {
      notify(error);
    } finally {
      this.#enable();
    }
  }

  #enable(may = this.#may) {
    for (const each of [this.#run_button, this.#queue_button, ...this.#motions.children]) each.disabled = !may;
  }

  async #queue() {
    try {
      const { at, every, priority, retry } = this.#when;
      const [first, again] = [Number(priority.value || 0), Number(retry.value || 0)];
      if (![first, again].every(Number.isInteger)) throw new Error("Priority and retries must be whole numbers.");
      const when = { at: at.value.trim(), every: every.value.trim(), priority: first, retry: again, needs_approval: this.#approval.getAttribute("aria-checked") === "true" };
      const answer = await this.#link.ask({ do: "add_task", mission: this.#mission.name, params: this.#params.values, ...this.#target.members(true), ...when });
      this.#target.reset_confirmation();
      notify(answer.message || `Task ${answer.task} is queued.`, "good");
    } catch (error) {
      notify(error);
    }
  }
}

function item(entry) {
  const { name, title, summary, trouble, shape, own } = entry;
  const words = `${name} ${title ?? ""} ${heading(entry)} ${summary}`.toLowerCase();
  const link = el("a", { href: `#run/${encodeURIComponent(name)}` },
    el("b", null, plain(title ?? name)), shape && sketch(shape), el("span", { class: trouble ? "trouble" : "" }, (trouble || summary).split("\n")[0]), own && el("small", null, name));
  return el("li", { "data-words": words }, link);
}

function checkup_lines(told) {
  if (!told) return ["None yet. Try: mission doctor"];
  const of = `${told.at.slice(0, 16).replace("T", " ")}${told.robot ? `, ${plain(told.robot)}` : ""}`;
  if (!told.ailing.length) return [`No problems found (${of}).`];
  const lines = told.ailing.map(({ part, about, message, verdict, fix }) =>
    el("li", null, el("b", null, `${verdict}: ${plain(part)}, ${about}`), ` ${message}`, el("br"), fix ? `Try: ${fix}` : ""));
  return [`mission doctor, ${of}:`, el("ul", null, ...lines)];
}
