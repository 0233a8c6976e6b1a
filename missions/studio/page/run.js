// Run: what there is to run, and a form to run it.

import { button, el, field, panel, put, tell, toggle } from "./dom.js";
import { Params, Target } from "./form.js";
import { links } from "./links.js";
import { pose } from "./pose.js";
import { sketch } from "./sketch.js";
import { plain } from "./words.js";
import "./tree.js";

export class Run {
  #link;
  #watcher;
  #library = null;
  #target = null;
  #mission = null;
  #chosen = "";
  #params = null;
  #search = el("input", { type: "search", placeholder: "Search missions", "aria-label": "Search missions" });
  #list = el("ul", { class: "missions" });
  #motions = el("div", { class: "motions", role: "group", "aria-label": "The eight motions" });
  #people = el("p", { class: "hint" });
  #person = el("input", { type: "text", autocomplete: "off" });
  #enrol = button("Add with the robot's camera", () => this.#add(false));
  #enrolHere = button("Add with this browser's camera", () => this.#add(true));
  #seen = el("div", { class: "pose" });
  #enrolling = el("div", { hidden: true }, field("Name", this.#person, "of who stands alone before the camera, and wants to be known"), el("div", { class: "actions" }, this.#enrol, this.#enrolHere), this.#seen);
  #checkup = el("div", { class: "hint" });
  #form = el("div", { class: "chosen" }, el("p", { class: "empty" }, "Reading the missions…"));
  #links = el("div", { hidden: true });
  #approval = toggle("Begin it only once somebody has approved it", false);
  #go = button("Run", () => this.#start(), { class: "main" });
  #when = {
    at: el("input", { type: "text", placeholder: "at once" }),
    every: el("input", { type: "text", placeholder: "once" }),
    priority: el("input", { type: "text", inputmode: "numeric", value: "0" }),
    retry: el("input", { type: "text", inputmode: "numeric", value: "0" }),
  };

  constructor({ link, watcher, stop }) {
    this.#link = link;
    this.#watcher = watcher;
    this.#links.append(links(link, stop));
    this.#search.addEventListener("input", () => this.#filter());
    const library = panel("Missions", "missions", this.#search, this.#list);
    this.node = el("div", { class: "view run" },
      el("div", { class: "side" }, panel("Motions", "eight", this.#motions), library, panel("People", "people", this.#people, this.#enrolling),
        panel("Check-up", "checkup", this.#checkup), this.#links),
      this.#form);
  }

  async show(name) {
    this.#links.hidden = this.#enrolling.hidden = this.#link.welcome?.role !== "operator";
    try {
      this.#library ??= await this.#fetch();
    } catch (error) {
      this.#form.replaceChildren();
      tell(error);
      return;
    }
    this.node.classList.toggle("has-chosen", Boolean(name));
    if (name) await this.#choose(name);
    else if (!this.#mission) this.#form.replaceChildren(el("p", { class: "empty" }, "Choose a mission."));
  }

  hide() {}

  async #fetch() {
    const library = await this.#link.library();
    this.#target = new Target(library);
    this.#target.node.addEventListener("change", () => this.#named());
    this.#list.replaceChildren(...library.missions.map(({ name, summary, trouble, shape }) => {
      const words = `${name} ${plain(name)} ${summary}`.toLowerCase();
      const link = el("a", { href: `#run/${encodeURIComponent(name)}` }, el("b", null, plain(name)), shape && sketch(shape), el("span", null, summary || trouble));
      return el("li", { "data-words": words }, link);
    }));
    this.#motions.replaceChildren(...library.motions.map((name, at) => {
      const node = button("", () => this.#move(name));
      node.append(el("b", null, String(at + 1)), el("span", null, plain(name.split("/").at(-1))));
      return node;
    }));
    put(this.#people, library.people.length ? `The robot knows ${library.people.join(", ")}.` : "The robot knows nobody yet: mission person add NAME");
    this.#checkup.replaceChildren(...checked(library.checkup));
    return library;
  }

  /** Let the robot know who stands before the camera of this browser (`here`), or of the run that is shown. */
  async #add(here) {
    const name = this.#person.value.trim();
    this.#enrol.disabled = this.#enrolHere.disabled = true;
    try {
      if (!name) throw new Error("What are they called?");
      if (!here && !this.#watcher.lives) throw new Error("Nothing runs: a camera is seen by way of a run, such as Drive without a mission.");
      tell("Look into the camera, and turn your head a little to each side…", "good");
      if (here) await pose(this.#seen, (words) => tell(words, "good"), (jpeg) => this.#link.ask({ do: "show_person", jpeg }));
      const { message } = await this.#link.ask({ do: "add_person", name, run: here ? "" : this.#watcher.run }, 70000);
      tell(message, "good");
      this.#library = null;
      await this.show(this.#chosen);
    } catch (error) {
      tell(error);
    } finally {
      this.#enrol.disabled = this.#enrolHere.disabled = false;
    }
  }

  #filter() {
    const words = this.#search.value.toLowerCase().split(/\s+/).filter(Boolean);
    for (const item of this.#list.children) item.hidden = !words.every((word) => item.dataset.words.includes(word));
  }

  async #choose(name) {
    if (this.#chosen === name) return;
    let mission;
    try {
      mission = await this.#link.ask({ do: "mission", name });
    } catch (error) {
      tell(error);
      this.#form.replaceChildren(el("p", { class: "empty" }, error.message));
      return;
    }
    this.#mission = mission;
    this.#chosen = name;
    this.#params = new Params(mission.params, this.#library.people);
    const tree = el("studio-tree", { class: "preview" });
    tree.draw(mission.drawing);
    const { at, every, priority, retry } = this.#when;
    this.#form.replaceChildren(
      el("p", { class: "back" }, el("a", { href: "#run" }, "‹ all missions")),
      el("h1", null, plain(mission.name)),
      el("p", { class: "summary" }, mission.summary),
      panel("Params", "params", this.#params.node),
      panel("On what", "target", this.#target.node),
      el("div", { class: "actions" }, this.#go),
      panel("Later, or again and again", "later",
        el("div", { class: "fields two" }, field("At", at, "18:00, or 2026-12-24 18:00"), field("Every", every, "30 min, day, monday 18:00"),
          field("Priority", priority, "-100 to 100: the highest is first"), field("Retry", retry, "how often to try again when it fails")),
        this.#approval,
        button("Add to the queue", () => this.#queue())),
      panel("Its tree", "preview", tree));
    this.#named();
  }

  #named() {
    const real = this.#target.real;
    put(this.#go, real ? "Run on the robot" : "Run simulated");
    this.#go.classList.toggle("real", real);
  }

  /** A motion: at once where it is simulated; on a robot by way of the form, where somebody confirms it. */
  #move(name) {
    if (this.#target.real || this.#link.welcome?.role !== "operator") location.hash = `#run/${encodeURIComponent(name)}`;
    else this.#launch(name, {});
  }

  #start() {
    try {
      this.#launch(this.#mission.name, this.#params.values);
    } catch (error) {
      tell(error.message);
    }
  }

  async #launch(mission, params) {
    const buttons = [this.#go, ...this.#motions.children];
    try {
      const members = this.#target.members();
      for (const each of buttons) each.disabled = true;
      tell(`${plain(mission)} is being started…`, "good");
      const { run, message } = await this.#link.ask({ do: "start", mission, params, ...members }, 60000);
      if (message) tell(message);
      this.#target.unsure();
      this.#watcher.follow(run);
      location.hash = "#live";
    } catch (error) {
      tell(error);
    } finally {
      for (const each of buttons) each.disabled = false;
    }
  }

  async #queue() {
    try {
      const { at, every, priority, retry } = this.#when;
      const [first, again] = [Number(priority.value || 0), Number(retry.value || 0)];
      if (![first, again].every(Number.isInteger)) throw new Error("Priority and retry are whole numbers.");
      const when = { at: at.value.trim(), every: every.value.trim(), priority: first, retry: again, needs_approval: this.#approval.getAttribute("aria-checked") === "true" };
      const answer = await this.#link.ask({ do: "add_task", mission: this.#mission.name, params: this.#params.values, ...this.#target.members(true), ...when });
      this.#target.unsure();
      tell(answer.message || `Task ${answer.task} waits.`, "good");
    } catch (error) {
      tell(error);
    }
  }
}

/** The last check-up in words: what ails, with what to try. */
function checked(told) {
  if (!told) return ["Not looked at yet: mission doctor"];
  const of = `${told.at.slice(0, 16).replace("T", " ")}${told.robot ? `, ${plain(told.robot)}` : ""}`;
  if (!told.ailing.length) return [`All was well (${of}).`];
  const lines = told.ailing.map(({ part, about, what, verdict, cure }) =>
    el("li", null, el("b", null, `${verdict}: ${plain(part)}, ${about}`), ` ${what}`, el("br"), cure ? `Try: ${cure}` : ""));
  return [`mission doctor, ${of}:`, el("ul", null, ...lines)];
}
