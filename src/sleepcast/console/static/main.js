// The page: what any robots have, and the panes that fit those that are there. What a pane knows it is told here, or in
// swarmpanes.js; panes do not know each other. Those that packages add get `page`.

import { ArrivalTool } from "./arrivals.js";
import { BodyLayer } from "./body.js";
import { Drawer } from "./drawer.js";
import { Filming } from "./filming.js";
import { Finder } from "./finder.js";
import { Layers } from "./layers.js";
import { showLine } from "./line.js";
import { Link } from "./link.js";
import { Measure } from "./measure.js";
import { ObstacleTool } from "./obstacles.js";
import { own } from "./panes.js";
import { GroundPicture } from "./picture.js";
import { Port } from "./port.js";
import { Safety } from "./safety.js";
import { splitter } from "./splitter.js";
import { swarmPanes } from "./swarmpanes.js";
import { givenTheme, theme } from "./theme.js";
import { Time } from "./time.js";
import { socket } from "./token.js";
import { Undo } from "./undo.js";
import { Wire } from "./wire.js";
import { World } from "./world.js";

const find = (id) => document.getElementById(id);
const press = (id) => find(id).click();
const embedded = document.body.classList.contains("embedded"); // in a notebook, whose widget carries the messages

const wire = new Wire(embedded ? () => new Port() : () => new WebSocket(socket()), !embedded);
const world = new World(document.querySelector(".world"));
const undo = new Undo(find("undone"));
const drawer = new Drawer(document.querySelector(".drawer"));
const time = new Time(document, wire);
new Safety(document, wire);
const panes = (own.panes ?? swarmPanes)({ find, press, wire, world, drawer, embedded, undo, follow, refused });
const { robot, senses } = panes;

// ---- from the desk

showLine(wire, find("offline"), panes.behind ?? "the station");

wire.addEventListener("hello", ({ detail }) => {
  const scene = { ...detail.scene, count: detail.count, unheard: detail.unheard, discs: Boolean(panes.discs) };
  find("title").textContent = scene.title;
  document.title = `${scene.title} · sleepcast`;
  for (const story of document.querySelectorAll(".story")) story.textContent = scene.story;
  panes.greet(detail, scene);
  world.setScene(scene);
  obstacles.renew();
  arrivals.renew();
  picture.setScene(scene);
  if (robot.index >= 0) wire.tell("watch", { robot: robot.index });
  panes.recolour();
});

wire.addEventListener("frame", ({ detail }) => {
  if (!world.scene || !world.setFrame(detail)) return;
  time.show(world.frame);
  panes.show(world.frame);
  link?.follow();
});

world.addEventListener("drawn", ({ detail }) => wire.tell("drawn", { number: detail.number }));

wire.addEventListener("obstacles", ({ detail }) => {
  world.setObstacles(detail.obstacles, detail.version, detail.tall);
  obstacles.renew();
});

wire.addEventListener("roll", ({ detail }) => world.setNames(detail.names));
wire.addEventListener("robot", ({ detail }) => robot.show(detail, world.frame ? world.lookOf(detail.robot) : null));
wire.addEventListener("refused", ({ detail }) => panes.refused(detail.reason));

// What was asked for without a question, such as STOP, and not done.
function refused(reason) {
  find("refused-text").textContent = reason;
  find("refused").hidden = !reason;
}

find("refused-close").addEventListener("click", () => refused(""));

// ---- the chosen robot

world.addEventListener("choose", ({ detail }) => {
  panes.choose(detail, detail < 0 ? "" : world.scene.names[detail]);
  follow(false);
  find("heard").textContent = detail < 0 ? "No robot chosen" : world.describe(detail);
});

function follow(on) {
  find("follow").setAttribute("aria-pressed", String(on));
  world.follow(on);
}

find("follow").addEventListener("click", () => {
  follow(!world.following);
  find("heard").textContent = world.following ? `Following ${world.scene.names[world.marks.chosen]}` : "Following nobody";
});
world.addEventListener("follow", () => find("follow").hidden || press("follow"));
world.addEventListener("moved", () => {
  find("follow").setAttribute("aria-pressed", String(world.following));
});

// ---- the room that panes take

const LEAST_SIDE = 280; // pixels
const side = document.querySelector(".side");
splitter(side.querySelector(".splitter"), {
  name: "side-width",
  vertical: false,
  read: () => side.offsetWidth,
  apply: (width) => {
    const most = document.documentElement.clientWidth / 2;
    document.documentElement.style.setProperty("--side", `${Math.max(LEAST_SIDE, Math.min(width, most))}px`);
  },
});
drawer.addEventListener("change", () => world.refit());

const link = embedded ? null : new Link(world, drawer, (index) => world.choose(index));

// ---- the finder

const ACTIONS = [
  ["Run or pause time", "Ctrl+Space", () => press("run")],
  ["Advance one tick", "Ctrl+.", () => press("step")],
  ["STOP every robot", "F9", () => press("stop")],
  ["Release STOP", "", () => press("release")],
  ["Show everything on the map", "F", () => press("fit")],
  ["Follow the chosen robot, or nobody", "Shift+C", () => find("follow").hidden || press("follow")],
  ["Trails on or off", "T", () => layers.toggle(panes.trails)],
  ["Measure a distance on the map", "M", () => press("measure")],
  ["Change obstacles", "", () => find("build").hidden || press("build")],
  ["Add robots", "", () => find("add-robot").hidden || press("add-robot")],
  ["Picture under the map on or off", "", () => layers.toggle("picture")],
  ["Layers of the map", "", () => layers.open(true)],
  ["Save a picture of the map", "PNG", () => press("save-picture")],
  ["Film the map, or stop filming", "WebM", () => press("save-film")],
  ["Light or dark", "", () => press("theme")],
  ["Keys and a short guide", "?", () => press("help")],
];

new Finder(find("finder"), [
  ...panes.finds.first,
  () => [...ACTIONS, ...panes.actions, ...undo.choices].map(([title, hint, run]) => ({ kind: "action", title, hint, run })),
  () => [...drawer.panes].map(([name, { tab }]) => ({ kind: "pane", title: tab.textContent, run: () => drawer.open(name) })),
  ...panes.finds.then,
  () => (world.scene?.names ?? []).flatMap((name, index) => (name ? [{ kind: "robot", title: name, run: () => chooseAndCentre(index) }] : [])),
]);

function chooseAndCentre(index) {
  world.choose(index);
  world.centreChosen();
}

// ---- view, theme, guide

find("zoom-in").addEventListener("click", () => world.zoom(1.4));
find("zoom-out").addEventListener("click", () => world.zoom(1 / 1.4));
find("fit").addEventListener("click", () => world.fit());

const layers = new Layers(find("layer-menu"), find("layers"), world, panes.layers, undo);
layers.addEventListener("erase", ({ detail }) => panes.erase(detail));
world.addEventListener("trails", () => layers.toggle(panes.trails));
new BodyLayer(world, senses);
const obstacles = new ObstacleTool(world, wire, find("obstacle-bar"), find("build"), undo);
const arrivals = new ArrivalTool(world, wire, find("arrival-bar"), find("add-robot"), [obstacles]);
find("build").addEventListener("click", () => arrivals.switch(false));
const picture = new GroundPicture(document.querySelector(".ground-picture"), world, wire, undo);
new Measure(world, find("measure"), find("heard"));
const films = { picture: find("save-picture"), film: find("save-film") };
new Filming(world, films, () => find("clock").textContent, () => panes.legend(), refused);

(embedded ? givenTheme : theme)(find("theme"), () => {
  world.recolour();
  robot.recolour(world.colours);
  panes.recolour();
});

find("help").addEventListener("click", () => find("guide").showModal());
window.addEventListener("keydown", (event) => {
  const typing = event.target.closest?.("textarea, input, select, dialog");
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "/") panes.focus();
  else if (event.key === "?") find("guide").showModal();
  else if (!panes.key(event.key)) return;
  event.preventDefault();
});

// ---- for panes that packages add: their modules import it

export const page = { wire, world, drawer, undo };
