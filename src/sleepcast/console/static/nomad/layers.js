// Layers: which are shown, and a way to erase each.

import { make } from "../elements.js";
import { LAYERS } from "./state.js";

export class Layers extends EventTarget {
  constructor(root, state) {
    super();
    const list = root.querySelector("#layer-list");
    list.replaceChildren(...LAYERS.map((layer) => this.line(layer, state)));
    const all = make("button", { type: "button", title: "Erase every layer of the chosen robot" }, "Erase all");
    all.addEventListener("click", () => this.erase("refresh_all"));
    list.append(make("li", {}, all));
  }

  line(layer, state) {
    const box = make("input", { type: "checkbox", checked: state.shown[layer.name] });
    box.dataset.layer = layer.name;
    box.addEventListener("change", () => {
      state.shown[layer.name] = box.checked;
      this.dispatchEvent(new Event("change"));
    });
    const sign = make("span", { className: `sign ${layer.name}`, ariaHidden: "true" });
    const button = make("button", { type: "button", title: `Erase: ${layer.title}` }, "erase");
    button.dataset.erase = layer.name;
    button.addEventListener("click", () => this.erase(layer.order));
    return make("li", {}, make("label", {}, box, sign, layer.title), button);
  }

  erase(order) {
    this.dispatchEvent(new CustomEvent("erase", { detail: order }));
  }
}
