// Folds a long command to its title and its first line, until somebody edits it or wants to see it all.

const LINES = 4; // of a text that is not folded

export class Fold {
  // editor: of the text. root: where the line above it is.
  constructor(editor, root) {
    this.editor = editor;
    this.box = editor.area.parentElement;
    this.head = root.querySelector("#folded");
    this.title = root.querySelector("#folded-title");
    this.length = root.querySelector("#folded-length");
    root.querySelector("#unfold").addEventListener("click", () => {
      this.unfold();
      editor.area.focus();
    });
    editor.addEventListener("change", () => this.unfold()); // another text, or an edited one
    editor.area.addEventListener("pointerdown", () => this.unfold());
  }

  get folded() {
    return !this.head.hidden;
  }

  // A text was put in, with this title and what it is about: fold it if it is long. The caret goes to its start, for that is what is seen.
  put({ title = "A long command", about = "" } = {}) {
    this.unfold();
    const { backdrop, area, text } = this.editor;
    const line = parseFloat(getComputedStyle(backdrop).lineHeight);
    const lines = Math.round(backdrop.scrollHeight / line);
    if (!line || lines <= LINES + 1) return; // the padding is less than a line
    this.head.hidden = false;
    this.box.classList.add("folded");
    this.title.textContent = title;
    const count = text.split("\n").length;
    const length = count > 1 ? `${count} lines` : `${text.length.toLocaleString("en")} characters`;
    this.length.textContent = about ? `${length} · ${about}` : length;
    area.setSelectionRange(0, 0);
    area.scrollTop = backdrop.scrollTop = 0;
  }

  unfold() {
    if (!this.folded) return;
    this.head.hidden = true;
    this.box.classList.remove("folded");
  }
}
