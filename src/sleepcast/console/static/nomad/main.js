// The page of the Nomads: puts the windows together. What a window knows it is told here.

import { showLine } from "../line.js";
import { Safety } from "../safety.js";
import { theme } from "../theme.js";
import { Time } from "../time.js";
import { Refusal, Wire } from "../wire.js";
import { About } from "./about.js";
import { Driver } from "./drive.js";
import { Files } from "./files.js";
import { Layers } from "./layers.js";
import { Orders } from "./orders.js";
import { Own } from "./own.js";
import { Sensors } from "./sensors.js";
import { State } from "./state.js";
import { World } from "./world.js";

const find = (id) => document.getElementById(id);
const address = new URL("live", window.location.href);
address.protocol = address.protocol.replace("http", "ws");
address.search = window.location.search; // the session's token

const wire = new Wire(() => new WebSocket(address));
const state = new State();
const world = new World(document.querySelector(".world"), state);
const own = new Own(document.querySelector(".robot"), state);
const sensors = new Sensors(document, state);
const about = new About(document, state);
const orders = new Orders(document.querySelector(".desk"), wire, state);
const layers = new Layers(document.querySelector(".world"), state);
const files = new Files(document.querySelector(".world"), wire);
const driver = new Driver(document, wire, state, [find("map"), find("own")]);
new Safety(document, wire);
const time = new Time(document, wire);

let pictures = 0; // that came
let drawn = 0; // the last of them that was drawn

// ---- from the server

showLine(wire, find("offline"), "the server");

wire.addEventListener("hello", ({ detail }) => {
  find("title").textContent = detail.title;
  document.title = `${detail.title} · sleepcast`;
  state.greet(detail);
  orders.setOrders(detail.orders);
  about.offer();
  look();
  world.resize();
});

wire.addEventListener("picture", ({ detail }) => {
  pictures += 1;
  const first = state.robots.length === 0;
  const traced = state.take(detail);
  if (first) world.refit();
  world.repaint(...(traced ? ["trails", "robots"] : ["robots"]));
  own.repaint();
  about.show();
  time.show(detail);
});

world.addEventListener("drawn", () => {
  if (drawn === pictures) return;
  drawn = pictures;
  sensors.draw();
  wire.tell("drawn", { number: drawn });
});

wire.addEventListener("solids", ({ detail }) => {
  const first = state.version === 0;
  state.solids = detail.solids;
  state.version = detail.version;
  world.builder.renew();
  if (first) world.refit();
});

wire.addEventListener("refused", ({ detail }) => orders.answer(detail.reason, true));

wire.addEventListener("lost", () => driver.release());

// ---- to the server

async function ask(kind, fields) {
  try {
    await wire.ask(kind, fields);
    return true;
  } catch (refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    orders.answer(refusal.message, true);
    return false;
  }
}

function choose(robot) {
  if (robot === state.chosen) return; // nothing is forgotten of it that the server would not tell again
  driver.release();
  state.choose(robot);
  look();
}

// Show the chosen robot, of which nothing is known yet.
function look() {
  wire.tell("watch", { robot: state.chosen });
  about.choose();
  orders.choose();
  own.begin();
  world.repaint("robots");
}

about.addEventListener("choose", ({ detail }) => choose(detail));
world.addEventListener("choose", ({ detail }) => choose(detail));
world.builder.addEventListener("ask", ({ detail }) => ask(...detail));
files.addEventListener("told", ({ detail }) => orders.answer(detail.text, detail.wrong));
own.addEventListener("answer", ({ detail }) => ask("click", detail));

world.addEventListener("place", ({ detail: { robot, pose } }) => {
  const numbers = [state.tenths(pose[0]), state.tenths(pose[1]), state.direction(pose[2]), state.direction(pose[3])];
  orders.give("place_robot", numbers, "", robot);
});

layers.addEventListener("erase", ({ detail }) => orders.give(detail, [], ""));
layers.addEventListener("change", () => {
  world.repaint();
  own.repaint();
  sensors.draw();
});

// ---- theme, keys, guide

theme(find("theme"), () => {
  world.recolour();
  own.recolour();
  sensors.recolour();
  if (state.kinds.length) about.offer();
});

find("help").addEventListener("click", () => find("guide").showModal());
window.addEventListener("keydown", (event) => {
  const typing = event.target.closest?.("textarea, input, select, dialog");
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  const number = Number(event.key) - 1;
  if (event.key === "/") orders.focus();
  else if (event.key === "?") find("guide").showModal();
  else if (number >= 0 && number < state.kinds.length) choose(number);
  else return;
  event.preventDefault();
});
