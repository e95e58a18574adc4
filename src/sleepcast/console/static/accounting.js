// The account of every command: on how many robots it matched, did not match, had an unknown test, went wrong, and who has
// not been heard.

const OUTCOMES = ["matched", "not_matched", "unknown", "fault", "silent"];
const OBEYED = [1, 5]; // codes of outcomes (station/sent.py): matched, and matched but held by STOP

export class Accounting extends EventTarget {
  constructor(root, wire) {
    super();
    this.wire = wire;
    this.root = root;
    this.rows = new Map(); // by id: {row, line}
    this.chosen = "";
    this.picked = ""; // the same if a person has chosen it, not only sent it
    this.time = 0; // of the picture
    this.wanted = ""; // the command whose line is to be brought into sight as soon as it is there
    root.querySelector("#commands").addEventListener("click", (event) => {
      const line = event.target.closest("tr");
      if (line) this.pick(line.dataset.id === this.chosen ? "" : line.dataset.id);
    });
    root.querySelector("#commands").addEventListener("keydown", (event) => this.key(event));
  }

  get latest() {
    return [...this.rows.values()].map(({ row }) => row).filter((row) => row.kind === "command").pop()?.id ?? "";
  }

  // Commands, newest first.
  get commands() {
    return [...this.rows.values()].map(({ row }) => row).filter((row) => row.kind === "command").reverse();
  }

  get(id) {
    return this.rows.get(id)?.row;
  }

  // rows: oldest first. Lines are kept and changed in place, so that focus and selection stay.
  set(rows) {
    const body = this.root.querySelector("#commands");
    const before = this.get(this.chosen);
    for (const id of [...this.rows.keys()].filter((id) => !rows.some((row) => row.id === id))) {
      this.rows.get(id).line.remove();
      this.rows.delete(id);
    }
    for (const row of rows) {
      let entry = this.rows.get(row.id);
      if (!entry) {
        entry = { line: this.line(row) };
        this.rows.set(row.id, entry);
      }
      entry.row = row;
      OUTCOMES.forEach((outcome, index) => {
        const cell = entry.line.querySelector(`.${outcome.replace("_", "-")}`);
        const waiting = outcome === "silent" && row.waiting;
        cell.textContent = waiting ? "–" : row[outcome].toLocaleString("en");
        cell.classList.toggle("none", waiting || row[outcome] === 0);
      });
      entry.line.classList.toggle("held", row.held > 0 || row.moving > 0);
      entry.line.querySelector(".held-up").textContent = heldUp(row);
      this.countDown(entry);
      this.fail(entry.line, row.failing);
      if (row.kind === "ask") entry.line.querySelector(".values").textContent = row.values;
    }
    this.rows = new Map(rows.map(({ id }) => [id, this.rows.get(id)]));
    [...this.rows.values()].reverse().forEach(({ line }, place) => {
      if (body.rows[place] !== line) body.insertBefore(line, body.rows[place] ?? null);
    });
    this.mark();
    this.root.querySelector("#no-commands").hidden = rows.length > 0;
    this.root.querySelector("#account").hidden = rows.length === 0;
    const now = this.get(this.chosen);
    if (before && now && [...OUTCOMES, "held", "not_stored", "moving", "waiting", "bids", "pending"].some((what) => before[what] !== now[what])) this.changed("counted");
    if (!now && this.chosen) this.choose("");
    if (this.rows.has(this.wanted)) this.bring(this.wanted);
  }

  // What a command that waits shows below its text: how many robots wait and for how long, and a way to call it off.
  countdown(row) {
    const line = Object.assign(document.createElement("div"), { className: "countdown", hidden: true });
    const left = Object.assign(document.createElement("span"), { role: "timer" });
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: "Cancel" });
    button.title = "Discards all commands of this sender that wait";
    button.onclick = (event) => {
      event.stopPropagation(); // the line is not chosen by that
      this.dispatchEvent(new CustomEvent("cancel", { detail: row.by }));
    };
    line.append(left, button);
    return line;
  }

  countDown({ row, line }) {
    const shown = line.querySelector(".countdown");
    if (!shown) return;
    shown.hidden = !row.pending;
    const left = Math.ceil(row.instant - this.time);
    const when = left > 0 ? `at ${clock(row.instant)}, in ${left < 60 ? `${left} s` : clock(left)}` : `since ${clock(row.instant)}`;
    const text = `${row.pending.toLocaleString("en")} waiting, ${when}`;
    if (shown.firstChild.textContent !== text) shown.firstChild.textContent = text;
    shown.lastChild.hidden = left <= 0;
  }

  // Time has gone on to so many s.
  tick(time) {
    this.time = time;
    for (const entry of this.rows.values()) this.countDown(entry);
  }

  // Scroll the line of a command that was sent here into sight, and no farther; the keyboard stays where it is.
  bring(id) {
    const line = this.rows.get(id)?.line;
    this.wanted = line ? "" : id;
    line?.scrollIntoView({ block: "nearest" });
  }

  line(row) {
    const line = document.createElement("tr");
    line.dataset.id = row.id;
    line.className = row.kind;
    line.tabIndex = -1;
    line.setAttribute("aria-selected", "false");
    line.setAttribute("role", "row");
    const text = line.insertCell();
    const time = Object.assign(document.createElement("time"), { textContent: clock(row.at) });
    const code = Object.assign(document.createElement("code"), { textContent: row.text.replace(/\s+/g, " ") });
    text.title = row.text;
    text.className = "text";
    const heldUp = Object.assign(document.createElement("div"), { className: "held-up" });
    text.append(time, ...byOf(row), ...sortOf(row), code, heldUp);
    if (typeof row.instant === "number") text.append(this.countdown(row));
    for (const outcome of OUTCOMES) line.insertCell().className = `count ${outcome.replace("_", "-")}`;
    if (row.kind === "ask") line.insertCell().className = "values";
    for (const cell of line.cells) cell.setAttribute("role", "cell");
    return line;
  }

  // What fails of the rules that a command brought: a button for each, which lights those robots.
  fail(line, rules) {
    const shown = line.querySelectorAll(".failing");
    const said = rules.map(({ rule, robots }) => `! rule ${rule} fails: ${robots.toLocaleString("en")}`);
    if (shown.length === said.length) {
      shown.forEach((button, at) => button.textContent === said[at] || (button.textContent = said[at]));
    } else {
      for (const button of shown) button.remove();
      const buttons = said.map((textContent) => Object.assign(document.createElement("button"), { type: "button", className: "failing", textContent }));
      line.querySelector(".text").append(...buttons);
    }
    line.querySelectorAll(".failing").forEach((button, at) => {
      button.title = `${rules[at].reason || "Deactivated because of its faults"}. Click to highlight these robots.`;
      button.onclick = (event) => {
        event.stopPropagation(); // the line is not chosen by that
        this.dispatchEvent(new CustomEvent("failing", { detail: rules[at].rule }));
      };
    });
  }

  pick(id) {
    this.picked = id;
    this.choose(id);
  }

  choose(id) {
    this.chosen = id;
    if (id !== this.picked) this.picked = "";
    this.mark();
    this.changed("choose");
  }

  // Say which line is chosen; the keyboard reaches it, or the first one if none is.
  mark() {
    const id = this.chosen;
    let first = true;
    for (const line of this.root.querySelector("#commands").rows) {
      const chosen = line.dataset.id === id;
      line.setAttribute("aria-selected", String(chosen));
      line.tabIndex = chosen || (first && !id) ? 0 : -1;
      first = false;
    }
  }

  // Tell what is known of the chosen command: "choose" if it is another one, "counted" if robots have answered.
  changed(event) {
    const row = this.get(this.chosen);
    if (row) {
      const first = row.kind === "ask" ? `${row.values}; answered` : "matched";
      const silent = row.waiting ? `${row.silent} waiting` : `silent ${row.silent}`;
      const failing = row.failing.map(({ rule, robots }) => `rule ${rule} fails on ${robots}`);
      const about = [heldUp(row), ...failing].map((said) => said && `${said}; `).join("");
      const counts = `${about}${first} ${row.matched}, not matched ${row.not_matched}, unknown ${row.unknown}, fault ${row.fault}, ${silent} ${row.scope}`;
      this.root.querySelector("#counts").textContent = counts;
    }
    this.dispatchEvent(new CustomEvent(event, { detail: row ?? null }));
  }

  key(event) {
    const line = event.target.closest("tr");
    if (!line || event.target.closest("button")) return;
    const other = { ArrowDown: line.nextElementSibling, ArrowUp: line.previousElementSibling }[event.key];
    if (event.key === "Enter" || event.key === " ") this.pick(line.dataset.id === this.chosen ? "" : line.dataset.id);
    else if (other) {
      this.pick(other.dataset.id);
      other.focus();
    } else return;
    event.preventDefault();
  }

  // Which robots the chosen command matched, 1 for each that it did.
  async lit() {
    const { outcomes } = await this.wire.ask("outcomes", { command: this.chosen });
    return Uint8Array.from(bytes(outcomes), (code) => (OBEYED.includes(code) ? 1 : 0));
  }
}

// What is said of a command that is not simply done once.
// Who has sent it, where several may.
function byOf(row) {
  return row.by ? [Object.assign(document.createElement("span"), { className: "by", textContent: row.by, title: `Sent by ${row.by}` })] : [];
}

function sortOf(row) {
  const kind = row.kind === "ask" ? "ask" : row.standing ? "standing" : "";
  return kind ? [Object.assign(document.createElement("span"), { className: "sort", textContent: kind })] : [];
}

// Who bids and is chosen; why robots have not done what the command says, although it was for them, or not yet; or may
// forget that they have.
function heldUp(row) {
  const held = row.held > 0 ? `held by STOP: ${row.held.toLocaleString("en")}` : "";
  const lost = row.not_stored > 0 ? `not stored: ${row.not_stored.toLocaleString("en")}` : "";
  const moving = row.moving > 0 ? `still moving: ${row.moving.toLocaleString("en")}` : "";
  return [row.bids, row.waiting && `waiting: ${row.waiting}`, held, moving, lost].filter(Boolean).join(" · ");
}

// Bytes from the base64 text that JSON carries.
export function bytes(base64) {
  return Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
}

// Seconds as hours, minutes and seconds.
export function clock(seconds) {
  const whole = Math.floor(seconds);
  const two = (number) => String(number).padStart(2, "0");
  return `${Math.floor(whole / 3600)}:${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
}
