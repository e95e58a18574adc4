// Orders to the chosen robot: buttons, fields, and a command line with completion, history and a sentence for mistakes.

import { History } from "../history.js";
import { Listbox } from "../listbox.js";
import { Refusal } from "../wire.js";
import { make } from "../elements.js";

const HINT = "An order and its numbers, such as vm 50 50. ↑ brings back earlier ones, Tab completes.";
const HERE = { x: 0, y: 1, steering: 2, turret: 3 }; // fields that begin as where the robot believes to be
const BEGIN = { vm: 50, pr: 100, sp: 100, ac: 300 }; // what a field begins with that has no usual number
const PLACES = ["dp", "da", "place_robot"];

export class Orders {
  // windows: as of windows.js
  constructor(root, wire, windows) {
    this.wire = wire;
    this.windows = windows;
    this.find = (id) => root.querySelector(`#${id}`);
    this.text = this.find("order");
    this.history = new History("orders");
    this.completions = new Listbox(this.find("order-completions"), this.text);
    this.table = new Map();
    this.form = null; // the order whose fields are shown
    this.underWay = new Set(); // lines that were sent and not answered
    this.given = 0; // orders
    this.listen();
  }

  listen() {
    this.text.addEventListener("input", () => this.typed());
    this.text.addEventListener("keydown", (event) => this.key(event));
    this.text.addEventListener("blur", () => this.hide());
    this.find("order-send").addEventListener("click", () => this.send());
    this.completions.addEventListener("take", (event) => this.put(event.detail));
    this.find("fields").addEventListener("submit", (event) => {
      event.preventDefault();
      this.submit();
    });
  }

  setOrders(orders) {
    this.table = new Map(orders.map((order) => [order.name, order]));
    this.find("orders").replaceChildren(
      ...orders.filter((order) => order.shown).map((order) => {
        const button = make("button", { type: "button", title: order.about }, order.name);
        button.dataset.order = order.name;
        button.addEventListener("click", () => this.press(order));
        return button;
      }),
    );
    this.open(this.table.get(this.form?.name ?? "vm"));
    this.typed();
  }

  // Another robot is looked at.
  choose() {
    this.find("addressee").textContent = this.nameOf(this.windows.chosen) ?? "–";
    if (this.form) this.open(this.form);
  }

  get steers() {
    return this.windows.steers?.[this.windows.chosen] ?? false;
  }

  nameOf(robot) {
    return this.windows.world.scene.names[robot];
  }

  get list() {
    return [...this.table.values()];
  }

  // Put an order into the line.
  put(name) {
    const order = this.table.get(name);
    this.text.value = order.fields.length || order.text ? `${name} ` : name;
    this.text.focus();
    this.typed();
  }

  focus() {
    this.text.focus();
  }

  // ---- buttons and fields

  press(order) {
    if (order.fields.length || order.text) {
      this.open(order);
      this.find("fields").querySelector("input")?.select();
    } else this.give(order.name, [], "");
  }

  // Show the fields of an order.
  open(order) {
    this.form = order;
    for (const button of this.find("orders").children) {
      button.setAttribute("aria-pressed", String(button.dataset.order === order.name));
    }
    const inputs = this.fieldsOf(order).map((field) => this.input(order, field));
    const send = make("button", { type: "submit" }, `Give ${order.name}`);
    this.find("fields").replaceChildren(make("code", {}, order.name), ...inputs, send);
    this.find("fields").title = order.about;
  }

  // What there is to fill in: a robot on two wheels has no third axis.
  fieldsOf(order) {
    const fields = order.fields.filter((field) => field.name !== "third" || this.steers);
    if (order.text) return [{ name: "words", text: true }];
    return order.more ? [...fields, { name: "sensors", list: true }] : fields;
  }

  input(order, field) {
    const input = make("input", { name: field.name });
    if (field.text || field.list) {
      Object.assign(input, { type: "text", maxLength: 256, className: "wide" });
      input.placeholder = field.list ? "0 2 15 1 14 3 …" : "";
    } else {
      Object.assign(input, { type: "number", step: 1, min: field.least, max: field.most, required: true });
      input.value = this.begin(order, field);
      input.title = `${field.unit ? `in ${field.unit}, ` : ""}${field.least} to ${field.most}`;
    }
    return make("label", {}, `${this.title(field)} `, input, make("i", {}, this.unit(field)));
  }

  // Of the two units that an axis may have, the one that it has on this robot: lengths are its way or its wheels'.
  unit(field) {
    const [length, angle] = (field.unit ?? "").split(" or ");
    const turns = this.steers && field.steered && field.steered !== "way";
    return turns ? (angle ?? length) : length;
  }

  title(field) {
    return (this.steers && field.steered) || field.name;
  }

  begin(order, field) {
    const { windows } = this;
    const place = HERE[field.name];
    const placed = PLACES.includes(order.name) && place !== undefined && windows.robot;
    if (!placed) return field.usual ?? BEGIN[order.name] ?? 0;
    const now = windows.robot.believed[place];
    return place < 2 ? windows.tenths(now) : windows.direction(now);
  }

  submit() {
    const inputs = [...this.find("fields").querySelectorAll("input")];
    const order = this.form;
    if (order.text) {
      this.give(order.name, [], inputs[0].value.trim());
      return;
    }
    const numbers = inputs.flatMap((input) => input.value.split(/[\s,]+/).filter(Boolean).map(Number));
    if (numbers.some((number) => !Number.isSafeInteger(number))) this.answer("These must be whole numbers.", true);
    else this.give(order.name, numbers, "");
  }

  // ---- the command line

  typed() {
    const line = this.text.value.trimStart();
    const [name] = line.split(/\s+/);
    const order = this.table.get(name);
    this.find("order-usage").replaceChildren(...(order ? this.usage(order) : [HINT]));
    const begun = line && !order && !/\s/.test(line);
    const fitting = begun ? [...this.table.values()].filter((each) => each.name.includes(name.toLowerCase())) : [];
    fitting.sort((a, b) => Number(b.name.startsWith(name)) - Number(a.name.startsWith(name)));
    const choices = fitting.map((each) => ({ value: each.name, parts: [["name", each.name], ["doc", each.about]] }));
    this.completions.show(document.activeElement === this.text ? choices.slice(0, 10) : []);
    this.text.setAttribute("aria-expanded", String(this.completions.open));
  }

  hide() {
    this.completions.hide();
    this.text.setAttribute("aria-expanded", "false");
  }

  usage(order) {
    const names = order.fields.map((field) => (field.usual === null ? this.title(field) : `[${this.title(field)}]`));
    if (order.more) names.push("…");
    if (order.text) names.push("words");
    return [make("code", {}, [order.name, ...names].join(" ")), ` ${order.about}`];
  }

  key(event) {
    if (event.isComposing) return;
    if (this.completions.open && this.completionKey(event)) event.preventDefault();
    else if (event.key === "Enter") this.send();
    else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
      const text = this.history.move(event.key === "ArrowUp" ? -1 : 1, this.text.value);
      if (text === null) return;
      event.preventDefault();
      this.text.value = text;
      this.typed();
      this.hide();
    }
  }

  completionKey(event) {
    if (event.key === "ArrowDown") this.completions.move(1);
    else if (event.key === "ArrowUp" && this.completions.at >= 0) this.completions.move(-1);
    else if (event.key === "Tab" && !event.shiftKey) this.completions.take();
    else if (event.key === "Enter" && this.completions.at >= 0) this.completions.take();
    else if (event.key === "Escape") this.hide();
    else return false;
    return true;
  }

  async send() {
    const line = this.text.value.trim();
    if (!line) return;
    const [name] = line.split(/\s+/, 1);
    const rest = line.slice(name.length).trim();
    const order = this.table.get(name);
    const words = order?.text ? [] : rest.split(/[\s,()]+/).filter(Boolean);
    const wrong = words.find((word) => !Number.isSafeInteger(Number(word)));
    if (order && wrong !== undefined) {
      const [usage] = this.usage(order);
      const wanted = usage.textContent.slice(name.length).trim() || "no numbers";
      this.answer(`“${wrong}” is no whole number: ${name} takes ${wanted}.`, true);
      return;
    }
    const numbers = wrong === undefined ? words.map(Number) : [];
    if (this.underWay.has(line)) return; // a key that is held, or pressed once more
    this.underWay.add(line);
    const done = await this.give(name, numbers, order?.text ? rest : "");
    this.underWay.delete(line);
    if (!done) return;
    this.history.add(line);
    if (this.text.value.trim() === line) this.text.value = "";
    this.typed();
  }

  // Give the chosen robot an order, which may take as long as it drives; whether it was done.
  async give(order, numbers, text, robot = this.windows.chosen) {
    const said = [order, ...numbers, ...(text ? [text] : [])].join(" ");
    const number = ++this.given;
    this.answer(`Robot ${this.nameOf(robot)} is to do: ${said}`, false);
    let note = "";
    try {
      ({ note } = await this.wire.ask("perform", { robot, order, numbers, text }, Infinity));
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.answer(`${said}: ${refusal.message}`, true);
      return false;
    }
    const last = number === this.given; // what was said of a later order stays
    if (last) this.answer([`Robot ${this.nameOf(robot)} was given: ${said}`, note].filter(Boolean).join(". "), false);
    return true;
  }

  answer(text, wrong) {
    this.find("answer").textContent = text;
    this.find("answer").classList.toggle("wrong", wrong);
  }
}
