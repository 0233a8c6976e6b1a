// Records: the list of past runs, one record, or two records side by side.

import { button, choice, el, panel, put, notify } from "./dom.js";
import { Record } from "./record.js";
import { SIGNS, bytes, day, result_text, plain, simulation_text, seconds } from "./words.js";

export class Records {
  #link;
  #records = [];
  #open = new Map();
  #names = "";
  #folder = el("p", { class: "hint" });
  #list = el("ul", { class: "record-list" });
  #list_panel = panel("Records", "records", this.#list, this.#folder);

  constructor({ link }) {
    this.#link = link;
    this.node = el("div", { class: "view records" }, this.#list_panel);
  }

  async show(...names) {
    const wanted = names.filter(Boolean).slice(0, 2);
    if (!wanted.length || !this.#records.length) await this.#fetch();
    if (wanted.join("/") === this.#names && wanted.length) return;
    this.#names = wanted.join("/");
    for (const each of this.#open.values()) each.end();
    if (!wanted.length) {
      this.node.replaceChildren(this.#list_panel);
      return;
    }
    const opened = new Map(wanted.map((name) => [name, this.#open.get(name) ?? new Record(this.#link, name)]));
    for (const [name, each] of this.#open) each.gone = !opened.has(name);
    this.#open = opened;
    this.node.replaceChildren(
      el("div", { class: "head" }, el("p", { class: "back" }, el("a", { href: "#records" }, "‹ all records")), this.#compare_choice(wanted)),
      wanted.length > 1 ? this.#comparison(wanted) : "",
      el("div", { class: wanted.length > 1 ? "pair" : "one" }, [...opened.values()].map((each) => each.node)));
    const [first, second] = opened.values();
    second?.lead(null);
    first.lead(second ?? null);
  }

  /** Return the comparison of two records: first different decision, ends and settings. */
  #comparison([name, other]) {
    const [said, table] = [el("p", null, "Comparing…"), el("table")];
    const became = (change) => (change ? `${seconds(change.t)}: ${change.status}${change.reason ? `, ${change.reason}` : ""}` : "did not reach it");
    const row = (what, a, b) => el("tr", null, el("th", { scope: "row" }, what), el("td", null, a), el("td", null, b));
    const show = ({ a, b, nodes, settings, split }) => {
      const there = split && Math.min(...[split.a, split.b].filter(Boolean).map((change) => change.t));
      said.replaceChildren(...(split ? [`First different decision: ${split.name || split.kind}, line ${split.line}. `, button("Show it", () => this.#open.get(name)?.go(there))] : [`No difference: ${nodes} nodes compared.`]));
      table.append(row("ended", ...[a, b].map(({ end }) => result_text(end?.result ?? "", end?.reason ?? ""))));
      if (split) table.append(row("decided", became(split.a), became(split.b)));
      for (const [what, pair] of Object.entries(settings)) table.append(row(plain(what), pair.a ?? "–", pair.b ?? "–"));
    };
    this.#link.ask({ do: "compare", name, other }).then(show, (error) => put(said, `${error.message}${error.hint ? `\nTry: ${error.hint}` : ""}`));
    return panel("Comparison", "compared", said, table);
  }

  hide() {
    for (const each of this.#open.values()) each.end();
  }

  #compare_choice([first, second]) {
    const others = this.#records.filter((each) => each.name !== first && !each.trouble);
    const select = choice([["", "no other record"], ...others.map((each) => [each.name, `${plain(each.mission)}, ${day(each.began)}`])], second ?? "");
    select.setAttribute("aria-label", "Compare with");
    select.addEventListener("change", () => {
      location.hash = `#records/${[first, select.value].filter(Boolean).map(encodeURIComponent).join("/")}`;
    });
    return el("label", null, "Compare with ", select);
  }

  async #fetch() {
    try {
      const { folder, records } = await this.#link.ask({ do: "records" });
      this.#records = records;
      put(this.#folder, records.length ? folder : `No records yet in ${folder}.`);
      this.#list.replaceChildren(...records.map((each) => this.#row(each)));
    } catch (error) {
      notify(error);
    }
  }

  #row(record) {
    if (record.trouble) return el("li", { class: "trouble" }, el("b", null, record.name), el("span", { class: "reason" }, record.trouble));
    return el("li", { class: record.result }, el("a", { href: `#records/${encodeURIComponent(record.name)}` },
      el("b", null, plain(record.mission)),
      el("span", { class: "outcome" }, `${SIGNS[record.result] ?? "?"} ${record.result || "unknown"}`),
      el("span", null, `${plain(record.robot)}, ${simulation_text(record.simulated)}`),
      el("span", null, day(record.began)),
      el("span", null, `${seconds(record.seconds)}, ${bytes(record.bytes)}`),
      record.reason && el("span", { class: "reason" }, record.reason)));
  }
}
