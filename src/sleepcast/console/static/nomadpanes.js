// The panes of Nomads, robots that programs drive: orders, driving by hand, each robot's own window and its sensors. What a pane
// knows it is told here; panes do not know each other.

import { Chooser } from "./chooser.js";
import { Driving } from "./drive.js";
import { NOMAD_LAYERS } from "./layers.js";
import { Orders } from "./orders.js";
import { RobotPane } from "./robot.js";
import { RobotWindow } from "./robotwindow.js";
import { SensorsPane } from "./sensors.js";
import { Traces } from "./traces.js";
import { Windows } from "./windows.js";
import { Refusal } from "./wire.js";
import { WorldFile } from "./worldfile.js";

// page: what all pages have, as main.js gives it. Gives what main.js tells and asks.
export function nomadPanes({ find, wire, world }) {
  const windows = new Windows(world);
  const orders = new Orders(document, wire, windows);
  const chooser = new Chooser(find("chooser"));
  const driving = new Driving(document, wire, windows, [find("map"), find("own")]);
  const own = new RobotWindow(find("own"), windows);
  const traces = new Traces(world, windows);
  const file = new WorldFile(document, wire);
  const said = "It has said nothing. A program says something with tk.";
  const robot = new RobotPane(document.querySelector(".robot"), wire, ["said", "told", "values"], { said });
  const sensors = new SensorsPane(world, windows, (layer) => world.shows(layer));
  find("own").after(sensors.root);
  sensors.shown(true);
  find("no-robot").hidden = true;
  find("tab-said").textContent = "Said";
  const tenths = (x, y) => `x ${windows.tenths(x)}  y ${windows.tenths(y)} (1/10 in)`;

  function greet({ nomads }, scene) {
    windows.greet(nomads);
    world.coordinates = tenths;
    chooser.offer(scene.names, world.colours);
  }

  function choose(index, name) {
    driving.release();
    robot.choose(index, `Robot ${name}`);
    chooser.choose(index);
    orders.choose();
  }

  // Nothing is known of the orders before the scene.
  wire.addEventListener("hello", ({ detail }) => orders.setOrders(detail.nomads.orders));
  wire.addEventListener("windows", ({ detail }) => {
    windows.take(detail);
    chooser.show(windows.robots);
  });
  wire.addEventListener("robot", ({ detail }) => own.setSaid(detail.said));
  wire.addEventListener("lost", () => driving.release());

  // Choosing the same robot again forgets nothing that the desk would not tell again.
  const look = (index) => index === windows.chosen || world.choose(index);
  chooser.addEventListener("choose", ({ detail }) => look(detail));
  own.addEventListener("answer", ({ detail }) => answer(detail));
  file.addEventListener("told", ({ detail }) => orders.answer(detail.text, detail.wrong));
  traces.addEventListener("place", ({ detail }) => {
    const [x, y, heading, turret] = detail.pose;
    const numbers = [windows.tenths(x), windows.tenths(y), windows.direction(heading), windows.direction(turret)];
    orders.give("place_robot", numbers, "", detail.robot);
  });

  async function answer(place) {
    try {
      await wire.ask("click", place);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      orders.answer(refusal.message, true);
    }
  }

  return {
    robot,
    senses: windows,
    layers: NOMAD_LAYERS,
    trails: "actual",
    actions: [
      ["Load obstacles from a file", "", () => find("load").click()],
      ["Save obstacles in a file", "", () => find("save").click()],
    ],
    finds: { first: [() => orders.list.map(({ name, about }) => ({ kind: "order", title: name, hint: about, run: () => orders.put(name) }))], then: [] },
    greet,
    show: () => {},
    choose,
    erase: (order) => orders.give(order, [], ""),
    refused: (reason) => orders.answer(reason, true),
    legend: () => [],
    recolour: () => {
      sensors.draw();
      own.repaint();
      if (world.scene) chooser.offer(world.scene.names, world.colours);
    },
    focus: () => orders.focus(),
    // 1 to 9 choose a robot.
    key: (key) => {
      const index = Number(key) - 1;
      if (!(index >= 0 && index < (world.scene?.count ?? 0))) return false;
      look(index);
      return true;
    },
  };
}
