// The robot pane: why the chosen robot obeyed a command or did not, what it knows, and the rules it runs.

import { clock } from "./accounting.js";
import { write } from "./elements.js";
import { picture } from "./shapes.js";
import { drawWhy } from "./why.js";
import { Refusal } from "./wire.js";

const FILLED = { why: "why-answer" };
const OTHERS = /^not a member of /; // why a command was for others: those who are in a group
const LOOKS = 8; // commands that are looked at, newest first, for one that was for this robot
const BRIEF = 48; // characters of a command in the list

const NONE = {
  said: 'No reports yet. (REPORT "fuel" fuel) makes robots report their fuel.',
  told: "Nobody has told it anything yet.",
};

export class RobotPane {
  // tabs: which there are; none: what stands in empty ones, as NONE.
  constructor(root, wire, tabs, none = {}) {
    this.root = root;
    this.wire = wire;
    this.tabs = tabs;
    this.none = { ...NONE, ...none };
    this.find = (id) => root.querySelector(`#${id}`);
    this.index = -1;
    this.command = null; // the row of the command that is asked about
    this.picked = false; // whether a person has picked it; else it is the newest that was for this robot
    this.commands = []; // all commands, newest first
    this.find("why-command").addEventListener("change", ({ target }) => {
      const row = this.commands.find((each) => each.id === target.value);
      this.about(row ?? this.commands[0] ?? null, Boolean(row));
    });
    this.open(tabs[0]);
    for (const name of tabs) {
      this.find(`tab-${name}`).addEventListener("click", () => this.open(name));
      this.find(`tab-${name}`).addEventListener("keydown", (event) => this.key(event, name));
    }
  }

  choose(index, name) {
    this.index = index;
    this.find("no-robot").hidden = index >= 0;
    this.find("robot").hidden = index < 0;
    this.find("follow").hidden = index < 0;
    this.find("wink").hidden = index < 0;
    this.find("robot-name").textContent = index < 0 ? "Robot" : name;
    this.find("robot-state").replaceChildren();
    for (const each of this.tabs) this.find(FILLED[each] ?? `pane-${each}`).replaceChildren(); // what stood there was said by another robot
    this.wire.tell("watch", { robot: index });
    this.askWhy();
  }

  // The command about which the robot is asked; null where there is none. picked: whether a person has picked it.
  about(row, picked = false) {
    this.command = row;
    this.picked = picked && row !== null;
    this.askWhy();
  }

  // Offer these commands, newest first.
  setCommands(rows) {
    const same = rows.length === this.commands.length && rows.every((row, at) => row.id === this.commands[at].id);
    this.commands = rows;
    if (same) return;
    const newest = new Option("the newest for this robot", "");
    this.find("why-command").replaceChildren(newest, ...rows.map((row) => new Option(`${clock(row.at)} ${brief(row.text)}`, row.id)));
    this.showPicked();
  }

  showPicked() {
    this.find("why-command").value = this.picked ? this.command.id : "";
    this.find("why-command").parentElement.hidden = this.commands.length < 2;
  }

  async askWhy() {
    const { index, command } = this;
    const pane = this.find("why-answer");
    if (index < 0 || !this.tabs.includes("why")) return;
    this.showPicked();
    if (!command) {
      pane.replaceChildren(sentence("No command has been sent yet. Send one to see why this robot obeys it or not."));
      return;
    }
    if (command.kind === "ask") {
      pane.replaceChildren(sentence("A question changes nothing; the answers are shown with it in the list of commands."));
      return;
    }
    if (command.kind !== "command") {
      pane.replaceChildren(sentence("STOP and RELEASE are not expressions: every robot that receives them obeys."));
      return;
    }
    const current = () => index === this.index && command.id === this.command?.id;
    try {
      const [row, why] = await this.explained(index, command);
      if (current()) drawWhy(pane, why, row);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      if (current()) pane.replaceChildren(sentence(refusal.message));
    }
  }

  // The explanation of this command; unless a person has picked it, of the newest one up to it that was not for a group in
  // which the robot is not.
  async explained(robot, command) {
    const ask = async (row) => [row, (await this.wire.ask("why", { robot, command: row.id })).why];
    const first = await ask(command);
    if (this.picked || !OTHERS.test(first[1].reason)) return first;
    const older = this.commands.slice(this.commands.findIndex((row) => row.id === command.id) + 1);
    for (const row of older.slice(0, LOOKS)) {
      try {
        const answer = await ask(row);
        if (!OTHERS.test(answer[1].reason)) return answer;
      } catch (refusal) {
        if (!(refusal instanceof Refusal)) throw refusal;
        break; // what came before is not known any more
      }
    }
    return first;
  }

  // News of the chosen robot: {robot, groups, state, values, rules, said, told}. look: how the map shows it, as `picture` takes it;
  // null while there is no map.
  show(news, look) {
    if (news.robot !== this.index) return;
    this.look = look;
    this.find("robot-state").replaceChildren(...(look ? [picture(...look)] : []), [...news.groups, ...news.state].join(" · "));
    fill(this.find("pane-values"), ["Name", "Value", "Kind"], news.values, (value) => [value.name, value.shown, value.kind], "No values yet.");
    fill(
      this.find("pane-rules"),
      ["Rule", "Active", "Last value", "Text"],
      news.rules,
      (rule) => [rule.priority ? `${rule.name} (priority ${rule.priority})` : rule.name, rule.active ? "● yes" : "○ no", rule.fault ? `! ${rule.fault}` : rule.value, rule.text],
      "This robot has no rules: it only answers messages. (RULE guard (WHEN (< fuel 10%) (ST))) gives it one.",
    );
    for (const [name, head] of [["said", "What it reported"], ["told", "What it was told"]]) {
      fill(this.find(`pane-${name}`), ["When", head], news[name], ({ at, text }) => [clock(at), text], this.none[name]);
    }
  }

  // The page has another theme.
  recolour(colours) {
    const icon = this.find("robot-state").querySelector("canvas");
    if (!icon) return;
    this.look[1] = colours;
    icon.replaceWith(picture(...this.look));
  }

  open(name) {
    for (const each of this.tabs) {
      const chosen = each === name;
      this.find(`tab-${each}`).setAttribute("aria-selected", String(chosen));
      this.find(`tab-${each}`).tabIndex = chosen ? 0 : -1;
      this.find(`pane-${each}`).hidden = !chosen;
    }
  }

  key(event, name) {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const next = this.tabs[(this.tabs.indexOf(name) + step + this.tabs.length) % this.tabs.length];
    this.open(next);
    this.find(`tab-${next}`).focus();
    event.preventDefault();
  }
}

function sentence(text) {
  return Object.assign(document.createElement("p"), { className: "empty", textContent: text });
}

// A table whose cells are changed in place while its rows stay the same.
function fill(pane, heads, rows, cellsOf, none) {
  if (!rows.length) {
    pane.replaceChildren(sentence(none));
    return;
  }
  let table = pane.querySelector("table");
  if (!table || table.tBodies[0].rows.length !== rows.length) {
    table = document.createElement("table");
    const head = table.createTHead().insertRow();
    for (const text of heads) head.append(Object.assign(document.createElement("th"), { scope: "col", textContent: text }));
    const body = table.createTBody();
    for (let i = 0; i < rows.length; i += 1) heads.forEach(() => body.rows[i] ?? body.insertRow());
    for (const line of body.rows) heads.forEach(() => line.insertCell());
    pane.replaceChildren(table);
  }
  rows.forEach((row, i) => {
    cellsOf(row).forEach((text, k) => {
      const cell = table.tBodies[0].rows[i].cells[k];
      write(cell, text);
      cell.classList.toggle("none", text === "unknown");
    });
  });
}

function brief(text) {
  const line = text.replace(/\s+/g, " ");
  return line.length > BRIEF ? `${line.slice(0, BRIEF)}…` : line;
}
