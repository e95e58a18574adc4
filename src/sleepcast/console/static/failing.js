// Rules that fail: a badge with their number, which lights the robots on which they do.

import { bytes } from "./accounting.js";
import { short } from "./scales.js";
import { Refusal } from "./wire.js";

export class Failing extends EventTarget {
  constructor(badge, wire) {
    super();
    this.badge = badge;
    this.wire = wire;
    this.rules = []; // {rule, robots, inactive, reason}
    this.chosen = null; // the rule whose robots are lit, "" for all rules, null for none
    badge.addEventListener("click", () => this.choose(this.chosen === null ? "" : null));
    wire.addEventListener("failing", ({ detail }) => this.set(detail.rules, detail.recent));
  }

  // recent: simulated seconds after a fault for which its rule counts as failing.
  set(rules, recent) {
    this.rules = rules;
    const { badge } = this;
    badge.hidden = rules.length === 0;
    if (rules.length) {
      const most = rules[0];
      const count = (number) => number.toLocaleString("en");
      badge.querySelector("b").textContent = rules.length === 1 ? count(most.robots) : `${rules.length} rules`;
      badge.querySelector(".words").textContent = rules.length === 1 ? `rule ${most.rule} fails on` : "failing:";
      badge.title = [
        ...rules.map(({ rule, robots, inactive, reason }) => {
          const off = inactive ? `, deactivated on ${count(inactive)}` : "";
          return `Rule ${rule} fails on ${count(robots)} robots${off}${reason ? `: ${reason}` : ""}`;
        }),
        recent ? `A rule counts as failing for ${short(recent)} s after a fault.` : "",
        "Click to highlight these robots.",
      ].filter(Boolean).join("\n");
      badge.setAttribute("aria-label", badge.title);
    }
    if (this.chosen !== null) this.choose(this.fails(this.chosen) ? this.chosen : null);
  }

  fails(rule) {
    return this.rules.some((each) => !rule || each.rule === rule);
  }

  // Light the robots on which this rule fails ("": any rule), or no longer (null).
  async choose(rule) {
    this.chosen = rule;
    this.mark();
    let marks = null;
    try {
      if (rule !== null) marks = bytes((await this.wire.ask("failed", { rule })).outcomes);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.chosen = null; // it does not fail any more
      this.mark();
    }
    if (this.chosen === (marks ? rule : null)) this.dispatchEvent(new CustomEvent("light", { detail: marks && { marks, rule } }));
  }

  // Something else says who is lit.
  forget() {
    this.chosen = null;
    this.mark();
  }

  mark() {
    this.badge.setAttribute("aria-pressed", String(this.chosen !== null));
  }
}
