// The table of robots: a row for each, a column for each expression. The desk sorts and filters; the page asks for the
// rows in sight, and some times a second for them anew, as long as the table can be seen.

import { bytes } from "./accounting.js";
import { write } from "./elements.js";
import { ExpressionField } from "./expression.js";
import { copy, download, fileName } from "./files.js";
import { keep, kept } from "./kept.js";
import { Refusal } from "./wire.js";

const ROW = 24; // pixels; table.css says the same
const AROUND = 20; // rows that are asked for above and below those in sight
const MAX_ROWS = 200; // at once, as console/incoming.py has it
const MAX_COLUMNS = 12;
const MAX_PICKED = 10000;
const AGAIN = 400; // ms between two looks at how things are now
const BY_NUMBER = -1;
const BY_GROUP = -2;
const FIXED = [["Robot", BY_NUMBER], ["Groups", BY_GROUP]]; // columns that are always there

export class Table extends EventTarget {
  // names(): a promise of the names that an expression may use.
  constructor(root, wire, names) {
    super();
    this.root = root;
    this.wire = wire;
    this.find = (part) => root.querySelector(`.table-${part}`);
    this.open = false;
    this.asking = false;
    this.wanted = true; // whether to ask again as soon as an answer is there
    this.title = "";
    this.robots = []; // names, by index
    this.there = 0; // how many robots there are
    this.columns = []; // expressions; none: those that the desk suggests
    this.sort = { by: BY_NUMBER, descending: false };
    this.where = "";
    this.answer = { columns: [], total: 0, first: 0, rows: [] };
    this.picked = new Set(); // indices of robots
    this.at = -1; // the row on which the keyboard is
    this.from = -1; // the row at which a range begins
    this.chosen = -1; // the robot that the page looks at
    this.lines = [];
    this.body = this.find("rows");
    this.space = this.find("space");
    this.add = new ExpressionField(this.find("add"), names);
    this.filter = new ExpressionField(this.find("filter"), names);
    this.listen();
    setInterval(() => {
      if (document.visibilityState === "visible") this.refresh(true);
    }, AGAIN);
  }

  listen() {
    this.add.addEventListener("take", ({ detail }) => {
      if (detail) this.addColumn(detail);
    });
    this.filter.addEventListener("take", ({ detail }) => {
      this.where = detail;
      this.body.scrollTop = 0;
      this.changed();
    });
    this.body.addEventListener("scroll", () => {
      this.find("head").style.transform = `translateX(${-this.body.scrollLeft}px)`;
      this.draw();
      this.refresh(false);
    });
    new ResizeObserver(() => {
      if (!this.open) return;
      this.draw();
      this.refresh(false);
    }).observe(this.body);
    this.body.addEventListener("click", (event) => {
      const line = event.target.closest(".table-row");
      if (line) this.pick(Number(line.dataset.at), event.shiftKey, event.ctrlKey || event.metaKey);
    });
    this.body.addEventListener("keydown", (event) => this.key(event));
    this.find("copy").addEventListener("click", () => this.export((text) => this.toClipboard(text)));
    this.find("download").addEventListener("click", () => this.export((text) => this.toFile(text)));
  }

  // names: by index, "" where no robot is.
  setNames(names) {
    this.robots = names;
    this.there = names.filter(Boolean).length;
    this.draw();
  }

  // Another scene: its robots, and the columns that were chosen for it before.
  setScene(scene) {
    this.setNames(scene.names);
    if (this.title === scene.title) return;
    this.title = scene.title;
    const before = kept(`table.${scene.title}`, {});
    const texts = Array.isArray(before.columns) ? before.columns.filter((text) => typeof text === "string") : [];
    this.columns = texts.slice(0, MAX_COLUMNS);
    this.sort = { by: BY_NUMBER, descending: false };
    this.picked.clear();
    this.changed();
  }

  // The pane was opened or closed.
  shown(open) {
    this.open = open;
    if (open) this.refresh(true);
  }

  setChosen(robot) {
    this.chosen = robot;
    this.draw();
  }

  // ---- what is asked for

  changed() {
    this.at = this.from = -1;
    this.refresh(true);
  }

  // Ask for the rows in sight, sorted anew or not; one question at a time.
  async refresh(again) {
    if (!this.open || !this.robots.length) return;
    if (this.asking) {
      this.wanted = this.wanted || again;
      this.later = true;
      return;
    }
    this.asking = true;
    try {
      do {
        this.later = false;
        const now = again || this.wanted;
        this.wanted = false;
        this.take(await this.wire.ask("rows", this.question(now)));
        again = false;
      } while (this.later && this.open);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message, true);
    } finally {
      this.asking = false;
    }
  }

  question(again) {
    const [first, count] = this.sight();
    const start = Math.max(0, first - AROUND);
    return {
      columns: this.columns,
      sort: this.sort.by,
      descending: this.sort.descending,
      where: this.where,
      first: start,
      count: Math.min(MAX_ROWS, first - start + count + AROUND),
      again,
    };
  }

  // The first row in sight, and how many are.
  sight() {
    return [Math.floor(this.body.scrollTop / ROW), Math.ceil(this.body.clientHeight / ROW) + 1];
  }

  take(answer) {
    const heads = JSON.stringify(answer.columns);
    this.answer = answer;
    if (heads !== this.heads) {
      this.heads = heads;
      this.drawHead();
    }
    this.space.style.height = `${answer.total * ROW}px`;
    this.body.setAttribute("aria-rowcount", String(answer.total + 1));
    const problems = answer.columns.filter(({ problem }) => problem).map(({ text, problem }) => `${text}: ${problem}`);
    if (answer.problem) this.say(`The filter is not right. ${answer.problem}`, true);
    else if (problems.length) this.say(problems[0], true);
    else if (!this.busy) this.count();
    this.draw();
  }

  count() {
    const [total, all] = [this.answer.total, this.there].map((number) => number.toLocaleString("en"));
    const rows = this.where ? `${total} of ${all} robots` : `${all} robots`;
    const picked = this.picked.size ? `, ${this.picked.size.toLocaleString("en")} selected` : "";
    this.say(`${rows}${picked}${this.answer.source ? ` · ${this.answer.source}` : ""}`);
  }

  say(text, wrong = false) {
    const place = this.find("told");
    write(place, text);
    place.title = text; // there may be room for a part of it
    place.classList.toggle("wrong", wrong);
  }

  // ---- columns

  get texts() {
    return this.answer.columns.map(({ text }) => text);
  }

  addColumn(text) {
    if (this.texts.length >= MAX_COLUMNS) {
      this.say(`There are ${MAX_COLUMNS} columns already: remove one first.`, true);
      return;
    }
    this.add.set("");
    this.setColumns([...this.texts, text]);
  }

  removeColumn(index) {
    if (this.sort.by === index) this.sort = { by: BY_NUMBER, descending: false };
    else if (this.sort.by > index) this.sort.by -= 1;
    this.setColumns(this.texts.filter((_, at) => at !== index));
  }

  setColumns(texts) {
    this.columns = texts;
    keep(`table.${this.title}`, { columns: texts });
    this.changed();
  }

  sortBy(by) {
    this.sort = { by, descending: this.sort.by === by && !this.sort.descending };
    this.body.scrollTop = 0;
    this.drawHead();
    this.changed();
  }

  drawHead() {
    const cells = FIXED.map(([text, by]) => this.headOf(text, "", by));
    this.answer.columns.forEach(({ text, unit, problem }, index) => {
      const cell = this.headOf(text, unit, index);
      cell.classList.toggle("wrong", problem !== "");
      cell.title = problem || text;
      const remove = document.createElement("button");
      remove.type = "button";
      remove.className = "table-remove";
      remove.textContent = "×";
      remove.title = `Remove the column ${text}`;
      remove.addEventListener("click", () => this.removeColumn(index));
      cell.append(remove);
      cells.push(cell);
    });
    this.find("head").replaceChildren(...cells);
    for (const line of this.lines) line.element.remove();
    this.lines = [];
    this.root.style.setProperty("--columns", String(cells.length));
  }

  headOf(text, unit, by) {
    const cell = document.createElement("div");
    cell.className = "table-cell";
    cell.setAttribute("role", "columnheader");
    const sorted = this.sort.by === by;
    cell.setAttribute("aria-sort", sorted ? (this.sort.descending ? "descending" : "ascending") : "none");
    const button = document.createElement("button");
    button.type = "button";
    button.className = "table-sort";
    button.title = `Sort by ${text}`;
    button.append(text, Object.assign(document.createElement("i"), { textContent: unit ? ` ${unit}` : "" }));
    button.addEventListener("click", () => this.sortBy(by));
    cell.append(button);
    return cell;
  }

  // ---- rows

  // Show the rows in sight, as far as they are known. Elements are used again, so scrolling makes none.
  draw() {
    const [first, count] = this.sight();
    const { answer } = this;
    const most = Math.max(0, Math.min(count, answer.total - first));
    while (this.lines.length < most) this.lines.push(this.newLine());
    this.lines.forEach((line, place) => this.drawLine(line, place < most ? first + place : -1));
  }

  newLine() {
    const element = document.createElement("div");
    element.className = "table-row";
    element.setAttribute("role", "row");
    const cells = Array.from({ length: FIXED.length + this.answer.columns.length }, () => {
      const cell = document.createElement("div");
      cell.className = "table-cell";
      cell.setAttribute("role", "gridcell");
      cell.append("");
      return cell;
    });
    element.append(...cells);
    this.space.append(element);
    return { element, texts: cells.map((cell) => cell.firstChild), at: -1 };
  }

  drawLine(line, at) {
    const { element } = line;
    if (at !== line.at) {
      line.at = at;
      element.hidden = at < 0;
      element.dataset.at = at;
      element.id = `robot-row-${at}`;
      element.style.transform = `translateY(${at * ROW}px)`;
      element.setAttribute("aria-rowindex", String(at + 2));
      element.classList.toggle("odd", at % 2 === 1);
    }
    if (at < 0) return;
    const row = this.row(at);
    const words = row ? [this.robots[row[0]] ?? "", row[1], ...row[2]] : [];
    line.texts.forEach((text, index) => {
      const word = words[index] ?? "";
      if (text.data !== word) text.data = word;
    });
    const selected = row !== undefined && (this.picked.has(row[0]) || row[0] === this.chosen);
    if (element.ariaSelected !== String(selected)) element.ariaSelected = String(selected);
    element.classList.toggle("here", at === this.at);
  }

  // What is known of a row: [robot, groups, cells].
  row(at) {
    return this.answer.rows[at - this.answer.first];
  }

  // ---- choosing

  // A row was chosen. range: with all rows since the last one; toggle: besides those that are selected.
  async pick(at, range, toggle) {
    const robot = this.row(at)?.[0];
    if (robot === undefined) return;
    this.at = at;
    if (range && this.from >= 0) {
      await this.pickRange(at);
      return;
    }
    this.from = at;
    if (toggle) {
      const robots = new Set(this.picked);
      if (!robots.delete(robot)) robots.add(robot);
      this.tell(robots);
    } else {
      if (this.picked.size) this.tell([]);
      this.dispatchEvent(new CustomEvent("choose", { detail: robot }));
    }
  }

  // Select the rows from the one where a range begins to this one.
  async pickRange(at) {
    const [first, last] = [Math.min(this.from, at), Math.max(this.from, at)];
    try {
      const { robots } = await this.wire.ask("range", { first, count: Math.min(last - first + 1, MAX_PICKED) });
      this.tell(new Int32Array(bytes(robots).buffer));
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message, true);
    }
  }

  tell(robots) {
    this.dispatchEvent(new CustomEvent("pick", { detail: [...robots] }));
  }

  // What is selected on the page, here or on the map: 1 for each robot.
  setPicked(marks) {
    this.picked = new Set();
    marks.forEach((mark, robot) => {
      if (mark) this.picked.add(robot);
    });
    this.count();
    this.draw();
  }

  key(event) {
    if (event.target !== this.body) return;
    const page = Math.max(1, Math.floor(this.body.clientHeight / ROW) - 1);
    const last = this.answer.total - 1;
    const moves = { ArrowDown: 1, ArrowUp: -1, PageDown: page, PageUp: -page, Home: -Infinity, End: Infinity };
    const step = moves[event.key];
    if (step !== undefined) this.goTo(Math.max(0, Math.min(last, this.at + step)), event.shiftKey);
    else if (event.key === "Enter") this.pick(this.at, false, false);
    else if (event.key === " ") this.pick(this.at, false, true);
    else if (event.key === "Escape" && this.picked.size) this.tell([]);
    else return;
    event.preventDefault();
    event.stopPropagation();
  }

  goTo(at, range) {
    if (range && this.from < 0) this.from = Math.max(0, this.at);
    this.at = at;
    const top = at * ROW;
    if (top < this.body.scrollTop) this.body.scrollTop = top;
    const below = top + ROW - this.body.clientHeight;
    if (below > this.body.scrollTop) this.body.scrollTop = below;
    this.body.setAttribute("aria-activedescendant", `robot-row-${at}`);
    this.draw();
    if (range) this.pickRange(at);
  }

  // ---- out of the page

  // Collect the table, or the selected rows of it, as CSV, and hand it on.
  async export(hand) {
    if (this.busy) return;
    this.busy = true;
    const robots = this.picked.size <= MAX_PICKED ? [...this.picked] : [];
    const parts = [];
    try {
      for (let done = false; !done; ) {
        const answer = await this.wire.ask("csv", { piece: parts.length, robots: parts.length ? [] : robots });
        parts.push(answer.text);
        done = answer.done;
        this.say(`${parts.length * 2000 < this.answer.total ? "Collecting rows …" : "Writing …"}`);
      }
      this.say(await hand(parts.join("")));
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message, true);
    } finally {
      setTimeout(() => (this.busy = false), 2000); // long enough to read what was done
    }
  }

  async toClipboard(text) {
    const rows = (text.split("\n").length - 2).toLocaleString("en");
    return (await copy(text)) ? `${rows} rows are on the clipboard.` : "The browser does not let this page copy: download the file instead.";
  }

  toFile(text) {
    download(fileName(this.title, "csv"), "text/csv", [text]);
    return "The file is in your downloads.";
  }
}
