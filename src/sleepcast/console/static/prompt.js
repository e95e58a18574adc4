// The prompt: an expression is typed, checked by the station while one types, previewed, confirmed and sent.

import { Editor } from "./editor.js";
import { write } from "./elements.js";
import { Fold } from "./fold.js";
import { History } from "./history.js";
import { callAt, isUnfinished, wordAt } from "./lisp.js";
import { Listbox } from "./listbox.js";
import { choice, fitting } from "./names.js";
import { Search } from "./search.js";
import { Refusal } from "./wire.js";

const PAUSE = 120; // ms without a key before the text is checked
const AGAIN = 1000; // ms after which the robots have moved enough to ask again who would obey
const NAMES_AGE = 2000; // ms for which the ranges of values in the list of names are good enough
const HINT = "↑ earlier commands";
const FIRST_HINT = "Enter starts time";
const MAX_NAMES = 12; // names offered at once
const MAX_CHARACTERS = 16384; // of a command, as console/incoming.py has it

// What robots whose test is true would do. most: how many may obey of those who bid, null for a command that chooses nobody.
function wouldOf(most) {
  if (most === null) return "would obey";
  return `would bid, ${most ? `${most.toLocaleString("en")} at most will obey` : "too few for any to obey"}`;
}

// Enter in a field that asks back; not of a key that is still held down from the question.
function onceMore(field, then) {
  field.addEventListener("keydown", (event) => {
    if (event.key !== "Enter") return;
    event.preventDefault();
    if (!event.repeat) then();
  });
}

export class Prompt extends EventTarget {
  constructor(root, wire) {
    super();
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.editor = new Editor(this.find("text"), this.find("backdrop"));
    this.fold = new Fold(this.editor, root);
    this.history = new History("history");
    this.names = [];
    this.namesAt = -Infinity;
    this.completions = new Listbox(this.find("completions"), this.editor.area);
    this.search = new Search(root, this.history);
    this.preview = null; // what the station said of the text that stands there now
    this.repeats = 1; // how often commands that work only together are sent
    this.refused = []; // why the station would not send it: until the text, or its kind, is another
    this.doubted = null; // the text that was doubted when it was sent: sent once more it is meant as it stands
    this.sending = false;
    this.trusting = false; // whether ready-made commands need no confirmation: where the robots are simulated
    this.waiting = false; // whether time starts with the first command
    this.ready = [];
    this.sent = new Set(); // texts of commands that went out
    this.listen();
  }

  listen() {
    this.editor.addEventListener("change", () => this.changed());
    this.editor.area.addEventListener("keydown", (event) => this.key(event));
    this.editor.area.addEventListener("blur", () => this.completions.hide());
    this.editor.area.addEventListener("click", () => this.completions.hide());
    document.addEventListener("selectionchange", () => this.showUsage());
    this.completions.addEventListener("take", (event) => this.complete(event.detail));
    this.find("send").addEventListener("click", () => this.send());
    const everybody = this.find("everybody-yes");
    everybody.addEventListener("change", () => this.showSend());
    for (const moved of ["focus", "blur"]) everybody.addEventListener(moved, () => this.showEverybody());
    onceMore(everybody, () => {
      everybody.checked = true;
      this.send();
    });
    this.find("sort").addEventListener("change", () => this.sorted());
    this.find("by").addEventListener("change", () => this.changed());
    onceMore(this.find("meant-count"), () => this.send());
    this.search.addEventListener("take", (event) => this.set(event.detail));
    this.search.addEventListener("end", () => this.focus());
    setInterval(() => {
      if (this.preview?.counted && !this.sending && document.visibilityState === "visible") this.ask();
    }, AGAIN);
  }

  focus() {
    this.editor.area.focus();
  }

  // Put a text in. focus: whether the person who reads the page means to type now. caret: where.
  set(text, focus = true, caret = text.length) {
    this.editor.set(text, caret);
    if (caret === text.length) this.fold.put(this.readyMade(text));
    this.completions.hide();
    if (focus) this.focus();
  }

  // ---- ready-made commands

  // repeats: how often those that work only together are sent, since the radio may lose one.
  setReady(commands, repeats = this.repeats) {
    this.ready = commands;
    this.repeats = repeats;
    this.find("ready").replaceChildren(
      ...commands.map((command, index) => {
        const button = document.createElement("button");
        button.type = "button";
        button.title = command.text;
        button.append(String(index + 1), " ", command.title);
        button.firstChild.replaceWith(Object.assign(document.createElement("b"), { textContent: index + 1 }));
        if (command.needs) button.append(Object.assign(document.createElement("span"), { className: "needs", textContent: `after ${command.needs}` }));
        button.addEventListener("click", () => this.set(command.text));
        return button;
      }),
    );
    this.showReady();
    const together = commands.filter((command) => command.together);
    if (together.length > 1) this.find("ready").prepend(this.playAll(together));
  }

  // The button that sends those that work only together.
  playAll(commands) {
    const numbers = commands.map((command) => this.ready.indexOf(command) + 1).join(", ");
    const button = document.createElement("button");
    button.type = "button";
    button.className = "all";
    button.textContent = "Play all";
    const often = this.repeats > 1 ? `, ${this.repeats} times, since the radio loses messages` : "";
    button.title = `They work only together: sends ${numbers}, in this order${often}`;
    button.addEventListener("click", () => this.sendAll(commands));
    return button;
  }

  // Send commands one after the other. What is refused stands in the prompt, with the reason, and ends it.
  async sendAll(commands) {
    if (this.sending) return;
    for (const { text } of Array(this.repeats).fill(commands).flat()) {
      this.set(text, false);
      this.find("sort").value = "once"; // whatever was chosen for what stood there
      this.sorted();
      this.find("everybody-yes").checked = this.trusting;
      if (!(await this.send())) return;
      this.markSent([text]);
    }
    if (this.next) this.set(this.next.text, false);
  }

  // The buttons of the ready-made commands, in their order.
  get buttons() {
    return [...this.find("ready").querySelectorAll("button:not(.all)")];
  }

  // The ready-made command that this text is.
  readyMade(text) {
    return this.ready.find((command) => command.text === text);
  }

  // The first ready-made command that has not been sent yet.
  get next() {
    return this.ready.find((command) => !this.sent.has(command.text));
  }

  markSent(texts) {
    const before = this.sent.size;
    for (const text of texts) this.sent.add(text);
    if (this.sent.size !== before) this.showReady();
  }

  showReady() {
    this.buttons.forEach((button, index) => {
      button.classList.toggle("sent", this.sent.has(this.ready[index].text));
      button.classList.toggle("next", this.ready[index] === this.next);
      const first = this.ready[this.ready[index].needs - 1];
      button.classList.toggle("early", first !== undefined && !this.sent.has(first.text));
    });
  }

  // ---- the kind of command

  get kind() {
    return this.find("sort").value;
  }

  // Another kind was chosen: a question changes nothing, so there is nobody who would obey.
  sorted() {
    this.refuse("");
    this.find("sort").dataset.sort = this.kind;
    this.find("send-text").textContent = this.kind === "ask" ? "Ask" : "Send";
    this.find("preview").classList.toggle("asking", this.kind === "ask");
    this.showPreview();
    this.showSend();
    this.tellPreview();
  }

  tellPreview() {
    this.dispatchEvent(new CustomEvent("preview", { detail: this.kind === "ask" ? null : this.preview }));
  }

  // ---- as whom

  // operators: pairs of name and role, the first one's desk being the page's own; none where nobody is named.
  setOperators(operators) {
    const select = this.find("by");
    const chosen = select.value;
    select.replaceChildren(...operators.map(([name, role]) => new Option(`${name}, ${role}`, name, false, name === chosen)));
    select.parentElement.hidden = operators.length === 0;
  }

  // What says in a message as whom it is sent; nothing where nobody is named.
  get by() {
    const { value } = this.find("by");
    return value ? { by: value } : {};
  }

  // ---- checking and previewing

  changed() {
    this.preview = null;
    this.refused = []; // and leaves the screen with the findings, when there is more to say
    this.doubted = null;
    this.askCount("");
    this.showPreview();
    this.showSend();
    this.showUsage();
    this.offer();
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.ask(), this.editor.text.trim() ? PAUSE : 0);
    this.dispatchEvent(new Event("typed"));
  }

  // Refuse a text that the station would not even read; whether it is one.
  refuseLong(text) {
    const count = [...text].length;
    if (count <= MAX_CHARACTERS) return false;
    const [has, may] = [count, MAX_CHARACTERS].map((number) => number.toLocaleString("en"));
    this.refuse(`This has ${has} characters, and a command may have ${may}: send it in parts.`);
    return true;
  }

  // A number is being dragged: what is shown stays until more is known, and one question is asked in each picture.
  async turned() {
    clearTimeout(this.timer);
    this.refused = [];
    this.doubted = null;
    this.dispatchEvent(new Event("typed"));
    this.turns = true;
    if (this.turning) return;
    this.turning = true;
    while (this.turns) {
      this.turns = false;
      await Promise.all([this.ask(true), new Promise(requestAnimationFrame)]);
    }
    this.turning = false;
  }

  // Ask what the station thinks of the text. moving: whether the answer is worth showing although the text is another one.
  async ask(moving = false) {
    const { text } = this.editor;
    if (!text.trim()) {
      this.showFindings();
      this.dispatchEvent(new CustomEvent("preview", { detail: null }));
      return;
    }
    if (this.refuseLong(text)) return;
    let answer;
    try {
      answer = await this.wire.ask("preview", { text, ...this.by });
    } catch {
      return; // the page says elsewhere that there is no connection; the next key asks again
    }
    if (text !== this.editor.text && !moving) return; // typed on meanwhile
    this.preview = answer;
    this.editor.mark(isUnfinished(this.editor.tokens) ? [] : answer.findings);
    this.showFindings();
    this.showPreview();
    this.showSend();
    this.tellPreview();
  }

  showPreview() {
    const answer = this.preview?.counted ? this.preview : null;
    for (const name of ["yes", "no", "unknown"]) {
      const count = answer ? answer[name].toLocaleString("en") : "–";
      write(this.find(name), count);
    }
    write(this.find("would"), wouldOf(answer?.most ?? null));
    this.find("unknown").parentElement.title = answer?.reasons.map(([why, count]) => `${count}: ${why}`).join("\n") ?? "";
    this.find("preview").classList.toggle("known", answer !== null);
    const everybody = (answer?.everybody ?? false) && this.kind !== "ask";
    if (this.find("everybody").hidden === everybody) {
      this.find("everybody").hidden = !everybody;
      // Who wrote a scenario meant its ready-made commands for the robots in it.
      this.find("everybody-yes").checked = this.trusting && this.readyMade(this.editor.text) !== undefined;
    }
    if (everybody) {
      this.everybodys = (answer.yes + answer.no + answer.unknown).toLocaleString("en");
      this.showEverybody();
    }
  }

  // How many robots a command to all is for, and what is to be pressed: after the first Enter the box has the focus.
  showEverybody() {
    const asked = document.activeElement === this.find("everybody-yes");
    const press = asked ? "Enter once more" : "Enter twice";
    write(this.find("everybody-text"), `This applies to all ${this.everybodys} robots. Send anyway? (${press})`);
  }

  // What is wrong with the text: why it was refused, which no later preview takes away, and what checking found.
  showFindings() {
    const refused = this.refused.map(({ shown }) => shown).join("\n");
    const findings = [...this.refused, ...(this.preview?.findings ?? []).filter(({ message }) => !refused.includes(message))];
    const key = JSON.stringify(findings);
    if (key === this.shownFindings) return; // a screen reader would say them again
    this.shownFindings = key;
    const unfinished = isUnfinished(this.editor.tokens);
    this.find("findings").hidden = findings.length === 0;
    this.find("findings").replaceChildren(
      ...findings.map((finding, index) => {
        const line = document.createElement("pre");
        line.className = unfinished && finding.severity === "error" ? "unfinished" : finding.severity;
        line.textContent = index === 0 ? finding.shown : finding.message;
        return line;
      }),
    );
  }

  showSend() {
    const wrong = this.preview?.findings.some((finding) => finding.severity === "error") ?? false;
    const open = !this.find("everybody").hidden && !this.find("everybody-yes").checked;
    this.find("send").disabled = !this.editor.text.trim() || wrong || open || this.sending;
  }

  // ---- sending

  // Send what stands there; whether it went out.
  async send() {
    const { text } = this.editor;
    if (!text.trim() || this.sending) return false;
    const box = this.find("everybody-yes");
    if (!this.find("everybody").hidden && !box.checked) {
      box.focus();
      return false;
    }
    if (this.refuseLong(text)) return false;
    this.refuse("");
    this.setSending(true); // the answer is about this text and this kind, so they stay until it comes
    try {
      const typed = this.find("meant").hidden ? NaN : this.find("meant-count").valueAsNumber;
      const count = Number.isInteger(typed) && typed >= 0 ? typed : null;
      const answer = await this.wire.ask("send", { text, everybody: box.checked, sort: this.kind, count, confirmed: text === this.doubted, ...this.by });
      this.setSending(false);
      this.history.add(text);
      this.find("sort").value = "once"; // what comes next is not meant to stand because this was
      this.sorted();
      this.editor.set("");
      this.dispatchEvent(new CustomEvent("sent", { detail: answer.command }));
      return true;
    } catch (refusal) {
      this.setSending(false);
      if (!(refusal instanceof Refusal)) throw refusal;
      if (refusal.doubt) this.doubted = text;
      if (refusal.count) this.askCount(refusal.message);
      else if (refusal.doubt) this.refuse(refusal.message, "warning");
      else this.refuse(refusal.message);
      return false;
    }
  }

  setSending(sending) {
    this.sending = sending;
    this.completions.hide();
    this.editor.lock(sending);
    this.find("sort").disabled = sending;
    this.showSend();
  }

  refuse(reason, severity = "error") {
    this.refused = reason ? [{ severity, shown: reason, message: reason }] : [];
    this.showFindings();
  }

  // For many robots, their number must be typed: the sentence says why; an empty one hides the field.
  askCount(sentence) {
    this.find("meant").hidden = !sentence;
    this.find("meant-text").textContent = sentence;
    this.find("meant-count").value = "";
    if (sentence) this.find("meant-count").focus();
  }

  // ---- keys

  key(event) {
    if (event.isComposing) return;
    if (this.completions.open && this.completionKey(event)) {
      event.preventDefault();
    } else if (event.key === "Enter" && !event.shiftKey) {
      event.preventDefault();
      if (!event.repeat) this.send(); // a key that is held down confirms nothing
    } else if (event.key === "r" && event.ctrlKey) {
      event.preventDefault();
      this.search.begin();
    } else if (event.key === "ArrowUp" && this.editor.onFirstLine() && !event.shiftKey) {
      this.turn(event, -1);
    } else if (event.key === "ArrowDown" && (this.fold.folded || this.editor.onLastLine()) && !event.shiftKey) {
      this.turn(event, 1);
    }
  }

  completionKey(event) {
    if (event.key === "ArrowDown") this.completions.move(1);
    else if (event.key === "ArrowUp") this.completions.move(-1);
    else if (event.key === "Tab" && !event.shiftKey) this.completions.take();
    else if (event.key === "Enter" && this.completions.at >= 0) this.completions.take();
    else if (event.key === "Escape") this.completions.hide();
    else return false;
    return true;
  }

  turn(event, step) {
    const text = this.history.move(step, this.editor.text);
    if (text === null) return;
    event.preventDefault();
    this.editor.set(text);
    this.fold.put(this.readyMade(text));
    this.completions.hide();
  }

  // ---- names

  // Offer what is known at once, and once more when the names are known as they are now.
  async offer() {
    this.offerNames();
    if (!this.begun() || performance.now() - this.namesAt < NAMES_AGE) return;
    const { text } = this.editor;
    const offered = this.completions.open;
    this.namesAt = performance.now();
    try {
      this.names = (await this.wire.ask("names")).names;
    } catch {
      return;
    }
    if (text !== this.editor.text || this.sending) return;
    const left = offered && !this.completions.open; // by Escape, say
    if (!left && this.completions.at < 0) this.offerNames(); // nobody is choosing yet
  }

  // The name that is being typed, or null.
  begun() {
    const word = wordAt(this.editor.tokens, this.editor.caret);
    const typing = document.activeElement === this.editor.area;
    return word && typing && this.editor.caret === word.end && word.text.length >= 2 ? word : null;
  }

  offerNames() {
    const word = this.begun();
    const fits = word && fitting(this.names, word, MAX_NAMES);
    if (!fits) {
      this.completions.hide();
      return;
    }
    this.completions.show(fits.map(choice));
    this.placeCompletions(word.start);
  }

  placeCompletions(offset) {
    const { list } = this.completions;
    const desk = list.parentElement.getBoundingClientRect();
    const at = this.editor.place(offset);
    const widest = Math.max(0, desk.width - list.offsetWidth - 8);
    list.style.left = `${Math.max(8, Math.min(at.left - desk.left - 10, widest))}px`;
    list.style.top = `${at.top - desk.top - list.offsetHeight - 6}px`;
  }

  complete(name) {
    const word = wordAt(this.editor.tokens, this.editor.caret);
    if (word) this.editor.replace(word.start, word.end, name);
    this.completions.hide();
  }

  // How the function around the caret is written.
  showUsage() {
    if (document.activeElement !== this.editor.area) return;
    const call = callAt(this.editor.tokens, this.editor.caret)?.toLowerCase();
    const known = call && this.names.find((name) => name.usage && name.name.toLowerCase() === call);
    if (!known) {
      this.showHint();
      return;
    }
    const usage = Object.assign(document.createElement("code"), { textContent: known.usage });
    this.find("usage").replaceChildren(usage, ` ${known.doc}`);
  }

  showHint() {
    this.find("usage").textContent = this.waiting ? FIRST_HINT : HINT;
  }

  setWaiting(waiting) {
    if (waiting === this.waiting) return;
    this.waiting = waiting;
    this.showHint(); // also while nobody types
    this.showUsage();
  }

  setNames(names) {
    this.names = names;
    this.namesAt = performance.now();
  }
}
