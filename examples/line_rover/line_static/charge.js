// The pane "Charge": who has the least left. It asks only while it is open.

import { make } from "../elements.js";
import { page } from "../main.js";
import { Refusal } from "../wire.js";

const REFRESH = 1000; // ms
const list = make("ol", { className: "charge" });
let asking = 0;

async function look() {
  let lines;
  try {
    const { rows } = await page.wire.ask("line_charge");
    lines = rows.map(([name, charge]) => `${name}: ${Math.round(100 * charge)} %`);
  } catch (refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    lines = [refusal.message];
  }
  list.replaceChildren(...lines.map((line) => make("li", {}, line)));
}

function shown(open) {
  clearInterval(asking);
  if (!open) return;
  asking = setInterval(look, REFRESH);
  look();
}

page.drawer.add({ name: "charge", title: "Charge", element: list, shown });
