// The pane of alerts: tests that the desk watches, what they have told, and what the robots' lights mean. What is new is
// told in a line at the top as well, whatever pane is open.

import { clock, bytes } from "./accounting.js";
import { label, make, section, write } from "./elements.js";
import { Refusal } from "./wire.js";

export class Alerts extends EventTarget {
  // notice: the line at the top. test: gives the test that stands in the prompt, "" for none.
  constructor(wire, notice, test) {
    super();
    this.wire = wire;
    this.notice = notice;
    this.seen = -1; // the latest firing that is known here, -1 before the first news
    this.told = []; // firings that the notice tells
    this.root = make("div", { className: "alerts" });
    this.text = make("input", { type: "text", maxLength: 1000, placeholder: "(< fuel 20%)", spellcheck: false, autocomplete: "off", required: true });
    this.above = make("input", { type: "number", min: 0, max: 10000000, value: 0, step: 1, required: true });
    this.problem = make("p", { className: "problem", role: "alert", hidden: true });
    this.list = make("ul");
    this.log = make("ol", { className: "firings" });
    this.meaning = make("input", { type: "text", maxLength: 1000, placeholder: "(> fuel 50%)", spellcheck: false, autocomplete: "off", required: true });
    this.root.append(
      section("Tests that are watched", this.form(test), this.problem, this.list),
      section("What they told", this.log),
      Object.assign(section("Lights: what they mean on all robots", this.lights(test)), { className: "lights" }),
    );
    notice.querySelector(".show").addEventListener("click", () => this.light(this.told.at(-1)));
    notice.querySelector(".close").addEventListener("click", () => this.read());
    wire.addEventListener("alerts", ({ detail }) => this.show(detail));
    this.show({ alerts: [], firings: [] }, true);
  }

  form(test) {
    const form = make(
      "form",
      {},
      label("Tell when", this.text),
      label("is true for more than", this.above),
      "robots",
      make("button", { type: "submit", className: "add" }, "Watch"),
      fromPrompt(this.text, test),
    );
    form.addEventListener("submit", async (event) => {
      event.preventDefault();
      if (await this.ask("addalert", { text: this.text.value, above: this.above.valueAsNumber || 0 })) this.text.value = "";
    });
    return form;
  }

  lights(test) {
    const off = make("button", { type: "button", title: "Put the command into the prompt that ends it" }, "Off");
    off.addEventListener("click", () => this.put("(WHEN (KNOWN light) (DEACTIVATE light) (UNMARK))"));
    const put = make("button", { type: "submit" }, "Put into the prompt");
    const form = make("form", {}, label("A robot shines while", this.meaning), put, off, fromPrompt(this.meaning, test));
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.put(`(RULE light (IF ${this.meaning.value.trim()} (MARK) (UNMARK)))`);
    });
    return form;
  }

  put(text) {
    this.dispatchEvent(new CustomEvent("put", { detail: text }));
  }

  // Ask for something; whether it was done.
  async ask(kind, fields) {
    this.say("");
    try {
      return await this.wire.ask(kind, fields);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message);
      return null;
    }
  }

  say(problem) {
    this.problem.textContent = problem;
    this.problem.hidden = !problem;
  }

  // ---- what there is

  show({ alerts, firings }, first = false) {
    const shape = JSON.stringify(alerts.map(({ alert, muted }) => [alert, muted]));
    if (shape !== this.shape) {
      this.shape = shape; // lines stay while they are the same, so that nobody loses the button under the finger
      this.list.replaceChildren(
        ...(alerts.length ? alerts.map((alert) => this.line(alert)) : [empty("None yet. Try (< fuel 20%): it tells of every robot whose fuel falls below.")]),
      );
    }
    alerts.forEach((alert, index) => this.update(this.list.children[index].querySelector(".about"), alert));
    const latest = firings.at(-1)?.firing ?? 0;
    if (first || latest !== this.seen) {
      this.log.replaceChildren(
        ...(firings.length ? [...firings].reverse().map((firing) => this.entry(firing)) : [empty("Nothing yet. A line here lights its robots on the map.")]),
      );
    }
    if (first) return;
    if (this.seen >= 0 && latest > this.seen) this.tell(firings.filter(({ firing }) => firing > this.seen));
    this.seen = latest;
    this.dispatchEvent(new CustomEvent("news", { detail: firings }));
  }

  line(alert) {
    const item = make("li", { className: alert.muted ? "muted" : "" });
    const mute = make("button", { type: "button", ariaPressed: String(alert.muted) }, alert.muted ? "Unmute" : "Mute");
    mute.addEventListener("click", () => this.ask("mutealert", { alert: alert.alert, muted: !alert.muted }));
    const remove = make("button", { type: "button" }, "Remove");
    remove.addEventListener("click", () => this.ask("removealert", { alert: alert.alert }));
    for (const button of [mute, remove]) button.setAttribute("aria-label", `${button.textContent} ${alert.text}`);
    item.append(
      make("span", { className: "bell", title: alert.muted ? "muted" : "watched" }, alert.muted ? "○" : "●"),
      make("code", {}, alert.text),
      make("span", { className: "about" }),
      mute,
      remove,
    );
    return item;
  }

  update(about, alert) {
    const above = alert.above ? `for more than ${alert.above.toLocaleString("en")}` : "for anybody";
    const now = alert.trouble || (alert.count < 0 ? "not known yet" : `true for ${alert.count.toLocaleString("en")} now`);
    const told = alert.fired ? `, told ${alert.fired === 1 ? "once" : `${alert.fired.toLocaleString("en")} times`}` : "";
    const text = `${above}: ${now}${told}${alert.muted ? ", muted" : ""}`;
    write(about, text);
    about.classList.toggle("trouble", alert.trouble !== "");
  }

  entry(firing) {
    const about = [make("time", {}, clock(firing.at)), make("code", {}, firing.text), firing.robots];
    const button = make("button", { type: "button", title: "Light these robots on the map" }, ...about);
    button.addEventListener("click", () => this.light(firing));
    return make("li", {}, button);
  }

  // ---- what is new

  tell(firings) {
    this.told.push(...firings);
    const last = this.told.at(-1);
    const more = this.told.length > 1 ? ` (and ${(this.told.length - 1).toLocaleString("en")} before)` : "";
    this.notice.querySelector(".text").textContent = `${clock(last.at)}  ${last.text}: ${last.robots}${more}`;
    this.notice.hidden = false;
  }

  read() {
    this.told = [];
    this.notice.hidden = true;
  }

  // Light the robots of a firing on the map.
  async light(firing) {
    const answer = await this.ask("fired", { firing: firing.firing });
    if (answer) this.dispatchEvent(new CustomEvent("light", { detail: { marks: bytes(answer.marks), firing } }));
    else this.dispatchEvent(new Event("open"));
    this.read();
  }
}

// The test of a command that begins with (WHEN test ...), or a text that is no command; "" where there is none.
export function testIn({ text, tokens, pairs }) {
  const [open, head, next] = tokens.filter(({ kind }) => kind !== "comment");
  if (open?.kind !== "open") return "";
  if (head?.text.toUpperCase() !== "WHEN") return /^(AND|OR|NOT|IN|KNOWN|INSIDE|[<>=]=?)$/i.test(head?.text) ? text.trim() : "";
  if (next?.kind !== "open") return next?.kind === "name" ? next.text : "";
  const end = pairs.get(next.start);
  return end < 0 ? "" : text.slice(next.start, end + 1).replace(/\s+/g, " ");
}

// A button that puts the test of the prompt into a field, if there is one.
function fromPrompt(field, test) {
  const button = make("button", { type: "button", className: "from-prompt", title: "Take the test that stands in the prompt" }, "From the prompt");
  button.addEventListener("click", () => {
    field.value = test() || field.value;
    field.focus();
  });
  return button;
}

function empty(text) {
  return make("li", { className: "empty" }, text);
}
