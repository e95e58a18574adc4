// The sentence beside the expression: under the prompt stands in English what is typed, if the station has a sentence
// for it; or a person types the sentence, and the expression follows. The two always say the same: while a sentence is
// not understood, there is no expression.

import { Editor } from "./editor.js";
import { Refusal } from "./wire.js";

const PAUSE = 120; // ms without a key before the station is asked

// Events: understood (detail: the expression, "" if there is none), send, lisp (the expression is typed again), turn
// (detail: the key's event, and the step to an earlier or a later command).
export class Sentence extends EventTarget {
  constructor(root, wire) {
    super();
    this.wire = wire;
    this.find = (id) => root.querySelector(`#${id}`);
    this.field = new Editor(this.find("sentence-text"), this.find("sentence-backdrop"), () => []);
    this.lisp = ""; // the expression that stands in the prompt
    this.shown = { sentence: "", parts: [] }; // what it says
    this.typing = false; // whether the sentence is typed, not the expression
    this.caret = -1;
    this.field.addEventListener("change", () => this.typed());
    this.field.area.addEventListener("keydown", (event) => this.key(event));
    this.find("sentence-mode").addEventListener("click", () => this.toggle());
  }

  // What the robots are called, for the example in an empty field.
  setNoun(noun) {
    this.field.area.placeholder = `For example: ${noun} in bravo stop`;
  }

  // Another expression stands in the prompt, whoever put it there.
  setLisp(text) {
    if (text === this.lisp) return;
    this.lisp = text;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.phrase(), text.trim() ? PAUSE : 0);
  }

  // The caret stands here in the expression: -1 for nowhere.
  setCaret(offset) {
    if (offset === this.caret) return;
    this.caret = offset;
    this.show();
  }

  // ---- from the expression to the sentence

  async phrase() {
    const text = this.lisp;
    let answer = { sentence: "", parts: [] };
    if (text.trim()) {
      try {
        answer = await this.wire.ask("phrase", { text });
      } catch (refusal) {
        if (!(refusal instanceof Refusal)) throw refusal;
      }
      if (text !== this.lisp) return; // typed on meanwhile
    }
    this.shown = answer;
    this.show();
    if (!this.typing) return;
    if (text.trim() && !answer.sentence) this.toggle(false); // there is no sentence to go on with
    else this.put(answer.sentence);
  }

  show() {
    const { sentence, parts } = this.shown;
    const around = parts.filter(([, , start, end]) => start <= this.caret && this.caret <= end);
    const [part] = around.sort((a, b) => a[1] - a[0] - (b[1] - b[0]));
    const line = this.find("sentence-shown");
    if (!part) {
      line.textContent = sentence;
      return;
    }
    const mark = document.createElement("mark");
    mark.textContent = sentence.slice(part[0], part[1]);
    line.replaceChildren(sentence.slice(0, part[0]), mark, sentence.slice(part[1]));
  }

  // ---- from the sentence to the expression

  // on: whether the sentence is to be typed; the other way round if nothing is said.
  toggle(on = !this.typing) {
    this.typing = on;
    this.find("sentence-mode").setAttribute("aria-pressed", String(on));
    this.find("sentence-field").hidden = !on;
    this.find("sentence-shown").hidden = on;
    this.find("sentence-unclear").hidden = !on; // keeps its line while somebody types, so that the map keeps its size
    this.tell([]);
    if (!on) {
      this.dispatchEvent(new Event("lisp"));
      return;
    }
    this.put(this.shown.sentence);
    this.field.area.focus();
  }

  // Put a sentence into the field that says what stands in the prompt.
  put(sentence) {
    if (this.field.text === sentence) return;
    this.putting = true;
    this.field.set(sentence);
    this.putting = false;
    this.tell([]);
  }

  typed() {
    if (this.putting) return;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.understand(), PAUSE);
  }

  // Whether what stands in the field is understood.
  async understand() {
    clearTimeout(this.timer);
    const { text } = this.field;
    let answer = { text: "", unclear: [] };
    if (text.trim()) {
      try {
        answer = await this.wire.ask("understand", { text });
      } catch (refusal) {
        if (!(refusal instanceof Refusal)) throw refusal;
        answer.unclear = [{ start: 0, end: 0, message: refusal.message, severity: "error" }];
      }
      if (text !== this.field.text || !this.typing) return false; // typed on meanwhile
    }
    this.tell(answer.unclear);
    if (answer.text !== this.lisp) {
      this.lisp = answer.text;
      this.dispatchEvent(new CustomEvent("understood", { detail: answer.text }));
    }
    return answer.text !== "";
  }

  // Underline what is not understood, or probably a slip, and say why of the first part.
  tell(unclear) {
    const line = this.find("sentence-unclear");
    const [first] = unclear;
    this.field.mark(unclear);
    const unfinished = unclear.every((each) => each.start === each.end);
    const what = first?.severity === "warning" ? "A slip?" : unfinished ? "Not finished" : "Not understood";
    line.textContent = first ? `${what}: ${first.message}` : "";
    line.classList.toggle("unfinished", unfinished);
  }

  async key(event) {
    if (event.isComposing || event.shiftKey) return;
    if (event.key === "Enter") {
      event.preventDefault();
      if (await this.understand()) this.dispatchEvent(new Event("send"));
    } else if (event.key === "ArrowUp" && this.field.onFirstLine()) {
      this.dispatchEvent(new CustomEvent("turn", { detail: { event, step: -1 } }));
    } else if (event.key === "ArrowDown" && this.field.onLastLine()) {
      this.dispatchEvent(new CustomEvent("turn", { detail: { event, step: 1 } }));
    }
  }
}
