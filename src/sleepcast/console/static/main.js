// The page: puts the panes together. What a pane knows it is told here; panes do not know each other.

import { Accounting, bytes, clock } from "./accounting.js";
import { Alerts, testIn } from "./alerts.js";
import { Blanks } from "./blanks.js";
import { BodyLayer } from "./body.js";
import { NumberDrag } from "./drag.js";
import { Drawer } from "./drawer.js";
import { write } from "./elements.js";
import { Failing } from "./failing.js";
import { copy } from "./files.js";
import { Filming } from "./filming.js";
import { Finder } from "./finder.js";
import { ghostsOf } from "./ghosts.js";
import { Glance } from "./glance.js";
import { Layers } from "./layers.js";
import { Legend } from "./legend.js";
import { Lights } from "./light.js";
import { showLine } from "./line.js";
import { Link } from "./link.js";
import { Measure } from "./measure.js";
import { NewRun } from "./newrun.js";
import { ObstacleTool } from "./obstacles.js";
import { Operators } from "./operators.js";
import { GroundPicture } from "./picture.js";
import { Plots } from "./plots.js";
import { Port } from "./port.js";
import { Prompt } from "./prompt.js";
import { RobotPane } from "./robot.js";
import { Safety } from "./safety.js";
import { Selecting } from "./select.js";
import { Senses } from "./senses.js";
import { SensorsPane } from "./sensors.js";
import { Sentence } from "./sentence.js";
import { splitter } from "./splitter.js";
import { Table } from "./table.js";
import { givenTheme, theme } from "./theme.js";
import { Time } from "./time.js";
import { Timeline } from "./timeline.js";
import { Undo } from "./undo.js";
import { Refusal, Wire } from "./wire.js";
import { World } from "./world.js";

const find = (id) => document.getElementById(id);
const embedded = document.body.classList.contains("embedded"); // in a notebook, whose widget carries the messages

const wire = new Wire(embedded ? () => new Port() : () => new WebSocket(address()), !embedded);
const world = new World(document.querySelector(".world"));
const undo = new Undo(find("undone"));
const legend = new Legend(find("legend"), wire, world);
const prompt = new Prompt(document.querySelector(".desk"), wire);
const sentence = new Sentence(document.querySelector(".desk"), wire);
const blanks = new Blanks(find("blanks"), prompt);
const accounting = new Accounting(document.querySelector(".accounting"), wire);
const failing = new Failing(find("failing"), wire);
const glance = new Glance(document.querySelector(".glance"), wire);
const robot = new RobotPane(document.querySelector(".robot"), wire);
new Safety(document, wire);
new NewRun(document, wire);
const time = new Time(document, wire);
const timeline = new Timeline(document.querySelector(".timeline"), wire);
const drawer = new Drawer(document.querySelector(".drawer")); // panes are added below: drawer.add(...)
const names = async () => (await wire.ask("names")).names;
const table = new Table(document.querySelector(".table-pane"), wire, names);
const plots = new Plots(document.querySelector(".plots-pane"), wire, names);
drawer.add({ name: "table", title: "Table", element: table.root, shown: (open) => table.shown(open) });
drawer.add({ name: "plots", title: "Plots", element: plots.root, shown: (open) => plots.shown(open) });
const senses = new Senses(world, wire);
const sensors = new SensorsPane(world, senses);
drawer.add({ name: "sensors", title: "Sensors", element: sensors.root, shown: (open) => sensors.shown(open) });

function address() {
  const found = new URL("live", window.location.href);
  found.protocol = found.protocol.replace("http", "ws");
  found.search = window.location.search; // the session's token
  return found;
}

const UPRIGHT = 1.35; // times as wide as high: worlds below it leave room beside the map
const LIT_FOR = 8000; // ms for which those that a command matched are lit

let begun = false; // whether the prompt was filled once
let groups = []; // {name, count, shown}, in the order of their codes in a frame
let lit = null; // {caption, count}: what the lit robots are
let faded = null; // the command whose light has gone out
let marked = ""; // the command whose mark on the timeline was chosen
let foretelling = false; // whether they are those that would obey what is typed, not those of the chosen command

// ---- from the station

showLine(wire, find("offline"), "the station");

wire.addEventListener("hello", ({ detail }) => {
  const scene = { ...detail.scene, count: detail.count, unheard: detail.unheard, groups };
  document.body.classList.toggle("replay", detail.recorded > 0);
  document.body.classList.toggle("air", detail.air);
  if (detail.air) offerAir();
  find("recorded").hidden = detail.recorded === 0;
  find("recorded").textContent = detail.part ? `recording, part ${detail.part}` : "recording";
  if (find("title").textContent !== scene.title) document.body.classList.toggle("upright", !detail.air && isUpright(scene.area));
  find("title").textContent = scene.title;
  document.title = `${scene.title} · sleepcast`;
  for (const story of document.querySelectorAll(".story")) story.textContent = scene.story;
  selecting.setCopies(detail.recorded > 0);
  prompt.trusting = !detail.air;
  write(find("legend-note"), detail.note);
  find("legend-note").hidden = !detail.note;
  prompt.setReady(scene.commands);
  blanks.set(scene.commands, scene.blanks);
  world.setScene(scene);
  obstacles.renew();
  picture.setScene(scene);
  table.setScene(scene);
  prompt.setNames(detail.names);
  sentence.setNoun(scene.noun);
  if (robot.index >= 0) wire.tell("watch", { robot: robot.index });
  drawLegend();
});

// Whether a world needs height more than width. On the air it may become another one with every robot that drives away.
function isUpright([left, bottom, right, top]) {
  return right - left < UPRIGHT * (top - bottom);
}

// What only robots on the air need: who commands them, and sending in stages.
function offerAir() {
  if (drawer.panes.has("operators")) return;
  const operators = new Operators(wire, find("staging"));
  drawer.add({ name: "operators", title: "Operators", element: operators.root });
  find("sort").append(new Option("in stages", "stages"));
}

wire.addEventListener("frame", ({ detail }) => {
  if (!world.scene) return;
  if (!world.setFrame(detail)) return;
  time.show(world.frame);
  timeline.show(world.frame.time);
  senses.ask();
  legend.tick(performance.now());
  glance.take(world.scene, world.frame, document.body.classList.contains("past"));
  link?.follow();
  document.body.classList.toggle("waiting", world.frame.waiting);
  prompt.setWaiting(world.frame.waiting);
});

wire.addEventListener("ghosts", ({ detail }) => world.setGhosts(ghostsOf(detail)));
timeline.addEventListener("ghosts", ({ detail }) => detail || world.setGhosts(null));

world.addEventListener("drawn", ({ detail }) => wire.tell("drawn", { number: detail.number }));

wire.addEventListener("commands", ({ detail }) => {
  accounting.set(detail.rows);
  prompt.markSent(detail.rows.map((row) => row.text));
  if (!begun) {
    begun = true;
    if (!prompt.editor.text) prompt.set(prompt.next?.text ?? "", !embedded);
    world.refit(); // a long command leaves less room for it
  }
  if (marked && accounting.get(marked)) accounting.choose(marked);
  if (accounting.get(marked)) marked = "";
  const latest = accounting.get(accounting.chosen) ?? accounting.get(accounting.latest) ?? null;
  const gone = robot.command !== null && !accounting.get(robot.command.id); // it was sent later than this page looks at
  if (gone || timeline.elsewhere || robot.command === null) if (latest?.id !== robot.command?.id) robot.about(latest);
});

wire.addEventListener("groups", ({ detail }) => {
  groups = detail.groups;
  legend.setGroups(groups);
  if (world.scene) world.scene.groups = groups;
  drawLegend();
});

wire.addEventListener("obstacles", ({ detail }) => {
  world.setObstacles(detail.obstacles, detail.version);
  obstacles.renew();
});

wire.addEventListener("robot", ({ detail }) => robot.show(detail, world.frame ? world.lookOf(detail.robot) : null));
wire.addEventListener("refused", ({ detail }) => refused(detail.reason));

// What was asked for without a question, such as STOP, and not done.
function refused(reason) {
  find("refused-text").textContent = reason;
  find("refused").hidden = !reason;
}

find("refused-close").addEventListener("click", () => refused(""));

// ---- the sentence beside the expression

prompt.addEventListener("typed", () => sentence.setLisp(prompt.editor.text));
document.addEventListener("selectionchange", () => {
  sentence.setCaret(document.activeElement === prompt.editor.area ? prompt.editor.caret : -1);
});
sentence.addEventListener("understood", ({ detail }) => prompt.set(detail, false));
sentence.addEventListener("send", () => prompt.send());
sentence.addEventListener("turn", ({ detail }) => prompt.turn(detail.event, detail.step));
sentence.addEventListener("lisp", () => prompt.focus());
window.addEventListener("keydown", (event) => {
  if (event.key !== ";" || !event.ctrlKey || event.altKey || event.metaKey || document.body.classList.contains("replay")) return;
  event.preventDefault();
  sentence.toggle();
});

// ---- who is lit

// caption: what they are; "" for those of a line of the legend, which says so itself.
function light(marks, caption, dark = false) {
  world.setLit(marks, dark);
  find("select-lit").disabled = !marks;
  lit = marks && caption ? { caption, count: marks.reduce((sum, mark) => sum + mark, 0) } : null;
  drawLegend();
}

// Whether a line of the legend, or a rule that fails, says who is lit.
const litElsewhere = () => Boolean(legend.chosen) || failing.chosen !== null;

// Nothing else says it any more: those that would obey what is typed, else those of the chosen command.
function lightAgain() {
  foretelling = prompt.editor.text.trim() !== "";
  if (foretelling) prompt.tellPreview();
  else lightChosen();
}

// What was touched last says who is lit: the text, the account, or the legend.
prompt.addEventListener("typed", () => {
  legend.forget();
  failing.forget();
  foretelling = prompt.editor.text.trim() !== "";
});

prompt.addEventListener("preview", ({ detail }) => {
  if (litElsewhere()) return;
  if (detail === null) lightChosen();
  else if (foretelling) light(detail.counted ? Uint8Array.from(bytes(detail.lit), (code) => (code === 1 ? 1 : 0)) : null, "would obey");
});

prompt.addEventListener("sent", async ({ detail }) => {
  try {
    const { rows } = await wire.ask("commands");
    accounting.set(rows);
    prompt.markSent(rows.map((row) => row.text));
    accounting.choose(detail);
    setTimeout(() => fade(detail), LIT_FOR);
  } catch (refusal) {
    if (!(refusal instanceof Refusal)) throw refusal; // else its line comes with the next news
  }
});

// Those that a command matched have been seen; whoever wants to see them again chooses the command.
function fade(command) {
  if (accounting.chosen !== command || foretelling || litElsewhere()) return;
  faded = command;
  world.fade();
}

accounting.addEventListener("choose", ({ detail }) => {
  faded = null;
  legend.forget();
  failing.forget();
  robot.about(detail ?? accounting.get(accounting.latest) ?? null);
  foretelling = false;
  if (detail) lightChosen();
  else lightAgain();
});

accounting.addEventListener("counted", ({ detail }) => {
  robot.about(detail);
  if (!foretelling && !litElsewhere()) lightChosen();
});

accounting.addEventListener("failing", ({ detail }) => failing.choose(detail));

failing.addEventListener("light", ({ detail }) => {
  legend.forget();
  foretelling = false;
  if (detail) light(detail.marks, detail.rule ? `rule ${detail.rule} fails` : "a rule fails");
  else lightAgain();
});

async function lightChosen() {
  const id = accounting.chosen;
  if (!id) {
    light(null);
    return;
  }
  try {
    const marks = await accounting.lit();
    const row = accounting.get(id);
    const caption = { stop: "stopped", release: "released", ask: "answered" }[row?.kind] ?? "matched";
    if (id === accounting.chosen && row && !litElsewhere()) light(marks, caption, id === faded);
  } catch (refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    if (id === accounting.chosen) light(null); // nobody knows whom it matched
  }
}

function drawLegend() {
  if (world.scene) legend.draw(lit);
}

legend.addEventListener("light", ({ detail }) => {
  failing.forget();
  if (detail) {
    foretelling = false;
    light(detail.marks, "");
    if (legend.following) world.followAll(detail.marks);
  } else lightAgain();
});

legend.addEventListener("follow", ({ detail }) => world.followAll(detail ? world.lit : null));

// ---- the chosen robot

world.addEventListener("choose", ({ detail }) => {
  robot.choose(detail, detail < 0 ? "" : world.scene.names[detail]);
  table.setChosen(detail);
  follow(false);
  find("heard").textContent = detail < 0 ? "No robot chosen" : world.describe(detail);
});

function follow(on) {
  find("follow").setAttribute("aria-pressed", String(on));
  world.follow(on);
}

find("follow").addEventListener("click", () => follow(!world.following));
world.addEventListener("moved", () => {
  find("follow").setAttribute("aria-pressed", String(world.following));
  legend.followed(world.flock !== null);
});

// ---- predicates by hand

new NumberDrag(prompt, wire, find("spread"));

const selecting = new Selecting(world, wire, find("selection"), find("lasso"), undo);
selecting.addEventListener("use", ({ detail }) => {
  if (document.body.classList.contains("replay")) copy(detail);
  else prompt.set(`(WHEN ${detail} )`, true, `(WHEN ${detail} `.length);
});

selecting.addEventListener("change", () => {
  world.picked = selecting.marks;
  table.setPicked(selecting.marks);
});

table.addEventListener("choose", ({ detail }) => world.choose(detail));
table.addEventListener("pick", ({ detail }) => {
  const marks = new Uint8Array(world.scene.count);
  for (const index of detail) marks[index] = 1;
  selecting.set(marks);
});

// Who would obey may be a second old; the test for them is looked for by what robots tell now.
async function selectLit() {
  if (foretelling) await prompt.ask();
  if (world.lit) selecting.set(world.lit, 0);
}

find("select-lit").addEventListener("click", selectLit);
world.map.addEventListener("keydown", (event) => {
  if (event.key.toLowerCase() === "s" && !event.ctrlKey && !event.metaKey && !event.altKey) selectLit();
});

// ---- alerts and lights

const alerts = new Alerts(wire, find("alerted"), () => testIn(prompt.editor));
drawer.add({ name: "alerts", title: "Alerts", element: alerts.root });
alerts.addEventListener("open", () => drawer.open("alerts"));
alerts.addEventListener("put", ({ detail }) => prompt.set(detail));
alerts.addEventListener("light", ({ detail }) => {
  failing.forget();
  foretelling = false;
  light(detail.marks, `alert ${clock(detail.firing.at)}`);
});

const lights = new Lights(world);
find("wink").addEventListener("click", async () => {
  const { index } = robot;
  lights.wink(index);
  try {
    await wire.ask("wink", { robot: index });
  } catch (refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    refused(refusal.message);
  }
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

const press = (id) => find(id).click();
const ACTIONS = [
  ["Run or pause time", "Ctrl+Space", () => press("run")],
  ["Advance one tick", "Ctrl+.", () => press("step")],
  ["Back to live", "F8", () => timeline.toLive()],
  ["New run: scenario, robots, seed", "", () => find("renew").hidden || press("renew")],
  ["STOP every robot", "F9", () => press("stop")],
  ["Release STOP", "", () => press("release")],
  ["Show everything on the map", "F", () => press("fit")],
  ["Trails on or off", "T", () => layers.toggle("trails")],
  ["Measure a distance on the map", "M", () => press("measure")],
  ["Change obstacles", "", () => find("build").hidden || press("build")],
  ["Picture under the map on or off", "", () => layers.toggle("picture")],
  ["Layers of the map", "", () => layers.open(true)],
  ["Save a picture of the map", "PNG", () => press("save-picture")],
  ["Film the map, or stop filming", "WebM", () => press("save-film")],
  ["Select robots with a lasso", "L", () => press("lasso")],
  ["Select the highlighted robots", "S", () => press("select-lit")],
  ["Type a sentence, or an expression again", "Ctrl+;", () => sentence.toggle()],
  ["Light or dark", "", () => press("theme")],
  ["Keys and a short guide", "?", () => press("help")],
];

function goTo(x, y) {
  follow(false);
  world.look(x, y);
}

new Finder(find("finder"), [
  () => prompt.ready.map(({ title, text }) => ({ kind: "command", title, hint: text, run: () => prompt.set(text) })),
  () => [...ACTIONS, ...undo.choices].map(([title, hint, run]) => ({ kind: "action", title, hint, run })),
  () => [...drawer.panes].map(([name, { tab }]) => ({ kind: "pane", title: tab.textContent, run: () => drawer.open(name) })),
  () => groups.map(({ name, count }) => ({ kind: "group", title: name, hint: `${count.toLocaleString("en")} robots`, run: () => prompt.set(`(WHEN (IN ${name}) )`) })),
  () => [...(world.scene?.places ?? []), ...(world.scene?.lights ?? [])].map(({ name, x, y }) => ({ kind: "place", title: name, run: () => goTo(x, y) })),
  () => [...prompt.history.items].reverse().map((text) => ({ kind: "earlier", title: text.replace(/\s+/g, " "), run: () => prompt.set(text) })),
  () => (world.scene?.names ?? []).map((name, index) => ({ kind: "robot", title: name, run: () => chooseAndCentre(index) })),
]);

function chooseAndCentre(index) {
  world.choose(index);
  world.centreChosen();
}

// ---- view, theme, guide

find("zoom-in").addEventListener("click", () => world.zoom(1.4));
find("zoom-out").addEventListener("click", () => world.zoom(1 / 1.4));
find("fit").addEventListener("click", () => world.fit());

timeline.addEventListener("jump", () => world.forgetTrails());
timeline.addEventListener("turned", () => robot.askWhy());
timeline.addEventListener("mark", ({ detail }) => {
  marked = detail.command; // its line is there when the news of then have come
});

const layers = new Layers(find("layer-menu"), find("layers"), world, undo);
world.addEventListener("trails", () => layers.toggle("trails"));
new BodyLayer(world, senses);
const obstacles = new ObstacleTool(world, wire, find("obstacle-bar"), find("build"), undo);
const picture = new GroundPicture(document.querySelector(".ground-picture"), world, wire, undo);
new Measure(world, find("measure"), find("heard"));
const films = { picture: find("save-picture"), film: find("save-film") };
new Filming(world, films, () => find("clock").textContent, () => legend.lines(), refused);

(embedded ? givenTheme : theme)(find("theme"), () => {
  world.recolour();
  robot.recolour(world.colours);
  plots.recolour();
  sensors.draw();
  drawLegend();
});

find("help").addEventListener("click", () => find("guide").showModal());
window.addEventListener("keydown", (event) => {
  const typing = event.target.closest?.("textarea, input, select, dialog");
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "/") prompt.focus();
  else if (event.key === "?") find("guide").showModal();
  else return;
  event.preventDefault();
});
