// The playground of the language's page: a box for an expression, a field for each reading of the robot, and what came of
// it. Python is loaded when the first expression is evaluated. Every example of the page can be taken into the box, which
// then moves below it.

const FIRST = "(WHEN (AND (< (DIST x y vessel_x vessel_y) 5mi) (> fuel 50%)) (JOIN bravo))";
const ARROW = " => ";

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

class Playground {
  constructor(root, readings) {
    this.root = root;
    this.worker = null;
    this.number = 0;
    this.text = make("textarea", { rows: 2, value: FIRST, spellcheck: false, autocapitalize: "off" });
    this.text.setAttribute("aria-label", "An expression");
    this.fields = new Map(Object.entries(readings).map(([name, value]) => [name, make("input", { value, size: 7 })]));
    this.readings = readings;
    this.shown = make("div", { className: "playground-shown" });
    this.shown.setAttribute("role", "status");
    const form = make(
      "form",
      {},
      make("div", { className: "playground-line" }, this.text, make("button", { className: "md-button md-button--primary" }, "Evaluate")),
      make(
        "fieldset",
        {},
        make("legend", {}, "What the robot measures; empty is unknown"),
        ...[...this.fields].map(([name, field]) => make("label", {}, name, field)),
      ),
    );
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.evaluate();
    });
    this.text.addEventListener("keydown", (event) => {
      if (event.key === "Enter" && !event.shiftKey && !event.isComposing) {
        event.preventDefault();
        form.requestSubmit();
      }
    });
    const note = "The robot of the examples, in your browser. Nothing is kept: what it would do is only told, and each expression meets a fresh robot.";
    root.replaceChildren(make("p", { className: "playground-title" }, "Try it"), form, this.shown, make("p", { className: "playground-note" }, note));
  }

  evaluate() {
    if (!this.worker) {
      this.worker = new Worker(new URL("worker.js", import.meta.url), { type: "module" });
      this.worker.addEventListener("message", ({ data }) => this.show(data));
      this.worker.addEventListener("error", () => this.fail("its files could not be loaded"));
      this.shown.replaceChildren(make("p", {}, "Loading Python (13 MB, once) ..."));
    }
    this.number += 1;
    const readings = Object.fromEntries([...this.fields].map(([name, field]) => [name, field.value]));
    this.worker.postMessage({ number: this.number, text: this.text.value, readings });
  }

  show({ number, found, failure }) {
    if (failure) this.fail(failure);
    else if (number === this.number) this.shown.replaceChildren(...(found.error ? [refusal(found.error)] : result(found)));
  }

  fail(reason) {
    this.worker.terminate();
    this.worker = null;
    this.shown.replaceChildren(refusal(`Python cannot be used here: ${reason}`));
  }

  // Take an example into the box, with the readings that are set before it (`:set fuel=0.8`); others are unknown there.
  take(example, lines, block) {
    const set = lines.map((line) => /^:set (\w+)=(\S+)/.exec(line)).filter(Boolean);
    const given = new Map(set.map(([, name, value]) => [name, value]));
    for (const [name, field] of this.fields) field.value = given.get(name) ?? "";
    this.text.value = example;
    block.after(this.root);
    this.text.focus();
    this.evaluate();
  }
}

function refusal(text) {
  return make("pre", { className: "playground-wrong" }, text);
}

function result({ value, said, deeds, course }) {
  const parts = [make("p", { className: "playground-value" }, make("code", {}, value))];
  if (deeds.length) parts.push(make("p", {}, "The robot would do: ", make("code", {}, deeds.join(" "))));
  if (said.length) parts.push(refusal(said.join("\n")));
  parts.push(make("details", { open: true }, make("summary", {}, "How it came about"), make("pre", {}, course)));
  return parts;
}

// A button at the end of each example of the page.
function offer(playground) {
  for (const block of document.querySelectorAll("div.sleep")) {
    const spans = [...block.querySelectorAll("code > span")];
    const lines = spans.map((span) => span.textContent.trimEnd());
    lines.forEach((line, i) => {
      const continued = lines[i + 1]?.startsWith(" ");
      if (!line.includes(ARROW) || line.startsWith(" ") || continued) return;
      const example = line.slice(0, line.indexOf(ARROW));
      const button = make("button", { type: "button", className: "playground-take", title: "Try it" });
      button.setAttribute("aria-label", `Try ${example}`);
      button.addEventListener("click", () => playground.take(example, lines.slice(0, i), block));
      spans[i].prepend(button);
    });
  }
}

const readings = await (await fetch(new URL("readings.json", import.meta.url))).json();
offer(new Playground(document.querySelector("#playground"), readings));
