// The panes of Nomads, robots that programs drive: orders, driving by hand, each robot's own window and its sensors. What a pane
// knows it is told here; panes do not know each other.

import { Chooser } from "./chooser.js";
import { Driving } from "./drive.js";
import { own } from "../panes.js";
import { Orders } from "./orders.js";
import { RobotPane } from "../robot.js";
import { RobotWindow } from "./robotwindow.js";
import { SensorsPane } from "../sensors.js";
import { Traces } from "./traces.js";
import { Windows } from "./windows.js";
import { Refusal } from "../wire.js";
import { WorldFile } from "./worldfile.js";

// order: what erases a layer, given to the chosen robot.
const LAYERS = [
  { name: "picture", title: "Picture under the map", on: true, hint: "That of the scenario's map, or one that you choose" },
  { name: "actual", title: "Actual trace", key: "T", on: true, order: "refresh_actual_trace" },
  { name: "encoder", title: "Encoder trace and position", on: true, hint: "Where each robot believes to be, dashed", order: "refresh_encoder_trace" },
  { name: "sonar", title: "Sonar", on: true, order: "refresh_sonar_sensor" },
  { name: "infrared", title: "Infrared", on: true, order: "refresh_infrared_sensor" },
  { name: "bumper", title: "Bumper", on: true, order: "refresh_bumper_sensor" },
  { name: "graphics", title: "Drawn by programs", on: true, order: "refresh_client_graphics" },
  { name: "names", title: "Names", on: true },
];

own.panes = nomadPanes;

// page: what all pages have, as main.js gives it. Gives what main.js tells and asks.
function nomadPanes({ find, wire, world }) {
  const windows = new Windows(world);
  const orders = new Orders(document, wire, windows);
  const chooser = new Chooser(find("chooser"));
  const driving = new Driving(document, wire, windows, [find("map"), find("own")]);
  const robotWindow = new RobotWindow(find("own"), windows);
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
  wire.addEventListener("robot", ({ detail }) => robotWindow.setSaid(detail.said));
  wire.addEventListener("lost", () => driving.release());

  chooser.addEventListener("choose", ({ detail }) => world.choose(detail));
  robotWindow.addEventListener("answer", ({ detail }) => answer(detail));
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
    layers: LAYERS,
    behind: "the server",
    discs: true,
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
      robotWindow.repaint();
      if (world.scene) chooser.offer(world.scene.names, world.colours);
    },
    focus: () => orders.focus(),
    // 1 to 9 choose a robot.
    key: (key) => {
      const index = Number(key) - 1;
      if (!(index >= 0 && index < (world.scene?.count ?? 0))) return false;
      world.choose(index);
      return true;
    },
  };
}
