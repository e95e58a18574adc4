// A list of choices under a text field; the field keeps the focus and names the chosen line to screen readers.

export class Listbox extends EventTarget {
  constructor(list, field) {
    super();
    this.list = list;
    this.field = field;
    this.choices = [];
    this.at = -1;
    list.addEventListener("pointerdown", (event) => {
      event.preventDefault(); // the field keeps the focus
      const line = event.target.closest("[role=option]");
      if (line) this.take(Number(line.dataset.at));
    });
  }

  get open() {
    return this.choices.length > 0;
  }

  // choices: {value, parts: [[class, text], ...]}; at: the one chosen to begin with, -1 for none.
  show(choices, at = -1) {
    this.choices = choices;
    this.list.hidden = choices.length === 0;
    this.list.replaceChildren(...choices.map((choice, index) => this.line(choice, index)));
    this.choose(choices.length ? at : -1);
  }

  hide() {
    this.show([]);
  }

  move(step) {
    const count = this.choices.length;
    this.choose(this.at < 0 && step < 0 ? count - 1 : (this.at + step + count) % count);
  }

  choose(at) {
    this.list.children[this.at]?.setAttribute("aria-selected", "false");
    this.at = at;
    const line = this.list.children[at];
    if (line) {
      line.setAttribute("aria-selected", "true");
      line.scrollIntoView({ block: "nearest" });
      this.field.setAttribute("aria-activedescendant", line.id);
    } else this.field.removeAttribute("aria-activedescendant");
  }

  take(at = Math.max(0, this.at)) {
    const choice = this.choices[at];
    this.hide();
    if (choice) this.dispatchEvent(new CustomEvent("take", { detail: choice.value }));
  }

  line(choice, index) {
    const line = document.createElement("li");
    line.id = `${this.list.id}-${index}`;
    line.dataset.at = index;
    line.setAttribute("role", "option");
    line.setAttribute("aria-selected", "false");
    for (const [kind, text] of choice.parts) {
      const part = document.createElement("span");
      part.className = kind;
      part.textContent = text;
      line.append(part);
    }
    return line;
  }
}
