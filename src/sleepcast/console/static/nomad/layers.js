// Layers: which are shown, and a way to erase each.

import { LAYERS } from "./state.js";

export class Layers extends EventTarget {
  constructor(root, state) {
    super();
    const list = root.querySelector("#layer-list");
    list.replaceChildren(...LAYERS.map((layer) => this.line(layer, state)));
    const all = Object.assign(document.createElement("button"), { type: "button", textContent: "Erase all", title: "Erase every layer of the chosen robot" });
    all.addEventListener("click", () => this.erase("refresh_all"));
    const item = document.createElement("li");
    item.append(all);
    list.append(item);
  }

  line(layer, state) {
    const item = document.createElement("li");
    const label = document.createElement("label");
    const box = Object.assign(document.createElement("input"), { type: "checkbox", checked: state.shown[layer.name] });
    box.dataset.layer = layer.name;
    box.addEventListener("change", () => {
      state.shown[layer.name] = box.checked;
      this.dispatchEvent(new Event("change"));
    });
    const sign = Object.assign(document.createElement("span"), { className: `sign ${layer.name}` });
    sign.setAttribute("aria-hidden", "true");
    label.append(box, sign, layer.title);
    const button = Object.assign(document.createElement("button"), { type: "button", textContent: "erase", title: `Erase: ${layer.title}` });
    button.dataset.erase = layer.name;
    button.addEventListener("click", () => this.erase(layer.order));
    item.append(label, button);
    return item;
  }

  erase(order) {
    this.dispatchEvent(new CustomEvent("erase", { detail: order }));
  }
}
