// A slider for a number of a scenario, with its name and its value.

export class Slider extends EventTarget {
  // {name, title, unit, value, low, high, step}, all numbers in the unit
  constructor({ name, title, unit, value, low, high, step }) {
    super();
    this.name = name;
    this.unit = unit;
    this.element = document.createElement("label");
    this.element.className = "slider";
    this.range = Object.assign(document.createElement("input"), { type: "range", min: low, max: high, step });
    this.range.value = value;
    this.shown = document.createElement("output");
    this.element.append(Object.assign(document.createElement("span"), { textContent: title }), this.range, this.shown);
    this.exact = value; // as it came: the slider itself stands on a step
    this.range.addEventListener("input", () => {
      this.exact = Number(this.range.value);
      this.show();
      this.dispatchEvent(new Event("input"));
    });
    this.show();
  }

  get value() {
    return this.exact;
  }

  // As a command has it.
  get text() {
    return `${Number(this.exact.toPrecision(12))}${this.unit}`;
  }

  show() {
    this.shown.textContent = `${Number(this.exact.toPrecision(6))} ${this.unit}`.trim();
    this.range.setAttribute("aria-valuetext", this.shown.textContent);
  }
}
