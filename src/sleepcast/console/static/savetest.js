// The session as a test: which counts of the commands shall be the same when it is run again, and what else shall hold.

import { bytes, clock } from "./accounting.js";
import { make } from "./elements.js";
import { download } from "./files.js";
import { Refusal } from "./wire.js";

const BOUNDS = [["exactly", "="], ["at least", "≥"], ["at most", "≤"], ["", "not held"]];

export class SaveTest {
  // root: the document. wire: to the station.
  constructor(root, wire) {
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.dialog = this.find("save-test");
    this.draft = null; // what the test would hold
    this.find("as-test").addEventListener("click", () => this.open());
    this.find("test-close").addEventListener("click", () => this.dialog.close());
    this.dialog.addEventListener("close", () => this.draft?.ran && wire.tell("pace", { running: true }));
    this.find("test-add").addEventListener("click", () => this.add());
    this.find("test-text").addEventListener("keydown", (event) => {
      if (event.key !== "Enter") return;
      event.preventDefault();
      this.add();
    });
    this.find("test-form").addEventListener("submit", (event) => {
      event.preventDefault();
      this.save();
    });
  }

  async open() {
    this.say("");
    this.draft = null;
    this.find("test-ended").textContent = "";
    this.find("test-commands").replaceChildren();
    this.find("test-goals").replaceChildren();
    this.enable(false);
    this.dialog.showModal();
    await this.asking(async () => {
      this.draft = await this.wire.ask("drafttest");
      this.find("test-name").value = this.draft.name;
      this.find("test-ended").textContent = `Time stands still: the test ends at ${clock(this.draft.ended)}.`;
      this.find("test-commands").replaceChildren(...this.draft.commands.map(row));
      this.enable(true);
    });
  }

  enable(on) {
    for (const id of ["test-save", "test-add"]) this.find(id).disabled = !on;
  }

  // One more goal: so many robots as now for which the expression is true.
  async add() {
    const text = this.find("test-text").value.trim();
    if (!text || !this.draft) return;
    this.say("");
    await this.asking(async () => {
      const { number } = await this.wire.ask("counttrue", { text });
      const remove = make("button", { type: "button", title: "Remove this goal" }, "×");
      const line = make("li", {}, make("code", {}, text), bound(number, `robots for which ${text}`), remove);
      remove.addEventListener("click", () => line.remove());
      line.dataset.text = text;
      this.find("test-goals").append(line);
      this.find("test-text").value = "";
    });
  }

  async save() {
    this.say("");
    const held = {};
    for (const line of this.find("test-commands").children) {
      if (!line.querySelector("input[type=checkbox]").checked) continue;
      const bounds = [...line.querySelectorAll(".bound")].map((each) => ({ count: each.dataset.count, ...chosen(each) }));
      held[line.dataset.id] = bounds.filter(({ how }) => how);
    }
    const lines = [...this.find("test-goals").children];
    const goals = lines.map((line) => ({ text: line.dataset.text, ...chosen(line) })).filter(({ how }) => how);
    const { tick } = this.draft;
    const fields = { tick, name: this.find("test-name").value, held, goals, exact: this.find("test-exact").checked };
    await this.asking(async () => {
      const { name, data } = await this.wire.ask("savetest", fields);
      download(name, "application/zip", [bytes(data)]);
      this.dialog.close();
    });
  }

  async asking(work) {
    try {
      await work();
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message);
    }
  }

  say(text) {
    this.find("test-refused").textContent = text;
    this.find("test-refused").hidden = !text;
  }
}

// A command with its counts.
function row({ id, at, text, counts }) {
  const hold = make("input", { type: "checkbox", checked: true });
  const shown = Object.entries(counts).filter(([name, count]) => name !== "held" || count);
  const bounds = shown.map(([name, count]) => {
    const field = bound(count, name);
    field.dataset.count = name;
    field.prepend(name);
    return field;
  });
  const words = make("code", { title: text }, text.replace(/\s+/g, " "));
  const line = make("li", {}, make("label", {}, hold, clock(at), words), make("div", { className: "bounds" }, ...bounds));
  line.dataset.id = id;
  hold.addEventListener("change", () => line.classList.toggle("off", !hold.checked));
  return line;
}

// A number, and what a count shall be to it.
function bound(number, name) {
  const how = make("select", { ariaLabel: `${name}: how` }, ...BOUNDS.map(([value, sign]) => new Option(sign, value)));
  const field = make("input", { type: "number", min: 0, max: 10000000, required: true, value: number, ariaLabel: name });
  how.addEventListener("change", () => (field.hidden = !how.value));
  return make("span", { className: "bound" }, how, field);
}

function chosen(element) {
  return { how: element.querySelector("select").value, number: element.querySelector("input[type=number]").valueAsNumber };
}
