// The operators' pane, on the air: who this desk is, who else commands, leases of groups, and what goes out in stages.

import { clock } from "./accounting.js";
import { label, make, section } from "./elements.js";
import { Refusal } from "./wire.js";

const WORDS = { take: "Take", request: "Ask for it", force: "Take by force", give: "Give back", grant: "Hand over" };

export class Operators {
  // root: the element of the pane, which is made here. staging: the element that says how far a staged sending is.
  constructor(wire, staging) {
    this.wire = wire;
    this.root = make("div", { className: "operators" });
    this.me = make("p", { className: "me" });
    this.others = make("ul");
    this.leases = make("ul");
    this.actions = make("ul", { className: "deeds" });
    this.problem = make("p", { className: "problem", role: "alert", hidden: true });
    this.group = make("input", { type: "text", maxLength: 64, required: true, placeholder: "bravo", spellcheck: false, autocomplete: "off" });
    this.seconds = make("input", { type: "number", min: 1, max: 3600, value: 60, step: 1, required: true });
    this.to = make("select");
    this.root.append(
      section("You and the others", this.me, this.others),
      section("Leases: a group obeys one operator only", this.form(), this.problem, this.leases),
      section("What others did", this.actions),
    );
    this.staging = staging;
    staging.querySelector("button").addEventListener("click", () => wire.tell("halt"));
    wire.addEventListener("operators", ({ detail }) => this.show(detail));
  }

  form() {
    const button = (action) => make("button", { type: "submit", value: action, title: TITLES[action] }, WORDS[action]);
    this.force = button("force");
    const form = make(
      "form",
      {},
      label("Group", this.group),
      label("Seconds", this.seconds),
      button("take"),
      button("request"),
      this.force,
      label("to", this.to),
      button("grant"),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.send(event.submitter?.value ?? "take", this.group.value.trim());
    });
    return form;
  }

  async send(action, group) {
    this.say("");
    try {
      const { doubt } = await this.wire.ask("lease", { deed: action, group, seconds: this.seconds.valueAsNumber || 60, to: action === "grant" ? this.to.value : "" });
      this.say(doubt ? `A slip? ${doubt}` : "");
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message);
    }
  }

  say(text) {
    this.problem.textContent = text;
    this.problem.hidden = !text;
  }

  show(news) {
    this.me.replaceChildren("You are ", make("b", {}, news.name), `, ${news.role}: you ${news.may}.`);
    list(this.others, news.others, (other) => [
      make("b", {}, other.name),
      ` ${other.role || "whose key is unknown here"}, ${other.at === null ? "not heard" : `heard at ${clock(other.at)}`}`,
    ], "No other operator is trusted or was heard.");
    const chosen = this.to.value;
    this.to.replaceChildren(...news.others.map(({ name }) => new Option(name, name, false, name === chosen)));
    this.force.disabled = news.role !== "commander";
    list(this.leases, news.leases, (lease) => {
      const give = make("button", { type: "button", title: TITLES.give }, WORDS.give);
      give.addEventListener("click", () => this.send("give", lease.group));
      const said = lease.refused ? `; refused: ${lease.refused}` : "";
      return [make("b", {}, lease.group), ` renewed until you give it back; ${lease.agreed.toLocaleString("en")} robots agreed${said} `, give];
    }, "You hold no lease.");
    list(this.actions, news.deeds, (action) => [make("time", {}, clock(action.at)), ` ${action.text}`], "Nothing was heard of others.");
    this.staging.hidden = !news.staging;
    this.staging.querySelector("span").textContent = news.staging;
    this.staging.querySelector("button").hidden = !news.active;
  }
}

const TITLES = {
  take: "Take or renew it; robots refuse while another operator holds it",
  request: "Like take, and its holder is told that you ask for it",
  force: "Take it from its holder; for commanders",
  give: "Give it back",
  grant: "Hand it to the operator chosen beside this button",
};

// Lines that are only made anew when they say something else, so that a button in one keeps the focus.
function list(element, rows, partsOf, none) {
  const key = JSON.stringify(rows);
  if (element.dataset.key === key) return;
  element.dataset.key = key;
  const lines = rows.map((row) => make("li", {}, ...partsOf(row)));
  element.replaceChildren(...(lines.length ? lines : [make("li", { className: "empty" }, none)]));
}
