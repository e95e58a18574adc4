// The panes of a swarm, simulated, recorded or on the air: prompt, account, why, tables and the rest. What a pane knows it is told
// here; panes do not know each other.

import { Accounting, bytes, clock } from "./accounting.js";
import { Alerts, testIn } from "./alerts.js";
import { Blanks } from "./blanks.js";
import { NumberDrag } from "./drag.js";
import { write } from "./elements.js";
import { Failing } from "./failing.js";
import { copy } from "./files.js";
import { alternatePoses } from "./alternate.js";
import { FieldLayer } from "./field.js";
import { Glance } from "./glance.js";
import { SWARM_LAYERS } from "./layers.js";
import { FootprintLayer } from "./footprints.js";
import { HeightLayer } from "./height.js";
import { Legend } from "./legend.js";
import { Lights } from "./light.js";
import { MissionPane } from "./mission.js";
import { NewRun } from "./newrun.js";
import { Operators } from "./operators.js";
import { Plots } from "./plots.js";
import { Prompt } from "./prompt.js";
import { RadioPane } from "./radio.js";
import { Relief } from "./relief.js";
import { Replies } from "./replies.js";
import { RobotPane } from "./robot.js";
import { SaveTest } from "./savetest.js";
import { Selecting } from "./select.js";
import { Senses } from "./senses.js";
import { SensorsPane } from "./sensors.js";
import { Sentence } from "./sentence.js";
import { SightLayer } from "./sight.js";
import { Space } from "./space.js";
import { Table } from "./table.js";
import { Timeline } from "./timeline.js";
import { Refusal } from "./wire.js";

const UPRIGHT = 1.35; // times as wide as high: worlds below it leave room beside the map
const LIT_FOR = 8000; // ms for which those that a command matched are lit

// page: what all pages have, as main.js gives it. Gives what main.js tells and asks.
export function swarmPanes({ find, press, wire, world, drawer, embedded, undo, follow, refused }) {
  const legend = new Legend(find("legend"), wire, world);
  const prompt = new Prompt(document.querySelector(".desk"), wire);
  const sentence = new Sentence(document.querySelector(".desk"), wire);
  const blanks = new Blanks(find("blanks"), prompt);
  const accounting = new Accounting(document.querySelector(".accounting"), wire);
  const failing = new Failing(find("failing"), wire);
  const glance = new Glance(document.querySelector(".glance"), wire);
  const robot = new RobotPane(document.querySelector(".robot"), wire, ["why", "values", "rules", "said"]);
  new NewRun(document, wire);
  new SaveTest(document, wire);
  const timeline = new Timeline(document.querySelector(".timeline"), wire);
  const names = async () => (await wire.ask("names")).names;
  const table = new Table(document.querySelector(".table-pane"), wire, names);
  const plots = new Plots(document.querySelector(".plots-pane"), wire, names);
  drawer.add({ name: "table", title: "Table", element: table.root, shown: (open) => table.shown(open) });
  drawer.add({ name: "plots", title: "Plots", element: plots.root, shown: (open) => plots.shown(open) });
  const radio = new RadioPane(wire);
  drawer.add({ name: "radio", title: "Radio", element: radio.root, shown: (open) => radio.shown(open) });
  const replies = new Replies(world, wire);
  const elsewhere = () => ["past", "replay"].some((name) => document.body.classList.contains(name));
  const field = new FieldLayer(world, wire, find("field-scale"), find("layer-menu"), elsewhere);
  const footprints = new FootprintLayer(world, find("layer-menu"));
  const relief = new Relief(world, find("layer-menu"));
  new HeightLayer(world, find("height-scale"));
  const senses = new Senses(world, wire);
  const sight = new SightLayer(world, wire, find("layer-menu"));
  const sensors = new SensorsPane(world, senses);
  drawer.add({ name: "sensors", title: "Sensors", element: sensors.root, shown: (open) => sensors.shown(open) });

  const mission = new MissionPane(find("mission"), wire);
  mission.addEventListener("there", () => {
    if (embedded) mission.bar.append(Object.assign(mission.root, { hidden: true })); // no drawer is in a cell
    else drawer.add({ name: "mission", title: "Mission", element: mission.root });
    world.refit(); // it leaves less room for the map
  });
  mission.addEventListener("open", () => {
    if (embedded) mission.root.hidden = !mission.root.hidden;
    else drawer.toggle("mission");
  });
  mission.addEventListener("put", ({ detail }) => {
    prompt.set(detail.text);
    find("sort").value = detail.sort;
    prompt.sorted();
  });

  let begun = false; // whether the prompt was filled once
  let groups = []; // {name, count, shown}, in the order of their codes in a frame
  let lit = null; // {caption, count}: what the lit robots are
  let faded = null; // the command whose light has gone out
  let fading = 0; // the timer after which the light of a command that was sent goes out
  let marked = ""; // the command whose mark on the timeline was chosen
  let foretelling = false; // whether they are those that would obey what is typed, not those of the chosen command

  function greet(hello, scene) {
    scene.groups = groups;
    if (world.scene?.title !== scene.title) document.body.classList.toggle("upright", !hello.air && isUpright(scene.area));
    document.body.classList.toggle("replay", hello.recorded > 0);
    document.body.classList.toggle("air", hello.air);
    if (hello.air) offerAir();
    find("recorded").hidden = hello.recorded === 0;
    find("recorded").textContent = hello.part ? `recording, part ${hello.part}` : "recording";
    selecting.setCopies(hello.recorded > 0);
    prompt.trusting = !hello.air;
    write(find("legend-note"), hello.note);
    find("legend-note").hidden = !hello.note;
    prompt.setReady(scene.commands, scene.repeats);
    blanks.set(scene.commands, scene.blanks);
    table.setScene(scene);
    field.setScene(scene);
    relief.setScene(scene);
    sight.setScene(scene);
    footprints.setScene(scene);
    prompt.setNames(hello.names);
    prompt.setOperators(hello.operators ?? []);
    sentence.setNoun(scene.noun);
  }

  // What only robots on the air need: who commands them, and sending in stages.
  function offerAir() {
    if (drawer.panes.has("operators")) return;
    const operators = new Operators(wire, find("staging"));
    drawer.add({ name: "operators", title: "Operators", element: operators.root });
    find("sort").append(new Option("in stages", "stages"));
  }

  function show(frame) {
    timeline.show(frame.time);
    accounting.tick(frame.time);
    senses.ask();
    sight.ask();
    field.ask();
    legend.tick(performance.now());
    glance.take(world.scene, frame, document.body.classList.contains("past"));
    document.body.classList.toggle("waiting", frame.waiting);
    prompt.setWaiting(frame.waiting);
  }

  wire.addEventListener("alternate", ({ detail }) => world.setAlternate(alternatePoses(detail)));
  timeline.addEventListener("alternate", ({ detail }) => detail || world.setAlternate(null));

  wire.addEventListener("commands", ({ detail }) => {
    accounting.set(detail.rows);
    if (replies.command) replies.count(accounting.get(replies.command));
    prompt.markSent(detail.rows.map((row) => row.text));
    robot.setCommands(accounting.commands);
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
    else if (foretelling) light(detail.counted ? Uint8Array.from(bytes(detail.lit), (code) => (code === 1 ? 1 : 0)) : null, (detail.most ?? null) !== null ? "would bid" : "would obey");
  });

  prompt.addEventListener("sent", async ({ detail }) => {
    accounting.bring(detail);
    try {
      const { rows } = await wire.ask("commands");
      accounting.set(rows);
      prompt.markSent(rows.map((row) => row.text));
      accounting.choose(detail);
      fading = setTimeout(() => fade(detail), LIT_FOR);
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

  // Whatever else has a use for Escape comes first; on the map it lets go of everything.
  window.addEventListener("keydown", ({ key, target, defaultPrevented }) => {
    if (key === "Escape" && (!defaultPrevented || target === world.map) && !target.closest?.("dialog")) replies.about(null);
  });

  accounting.addEventListener("choose", ({ detail }) => {
    if (!detail || detail.kind === "ask") replies.about(detail); // a command leaves the answers to a question there
    faded = null;
    clearTimeout(fading); // who chooses a command again wants to see it for longer
    legend.forget();
    failing.forget();
    robot.about(detail ?? accounting.get(accounting.latest) ?? null, Boolean(detail) && accounting.picked === detail.id);
    foretelling = false;
    if (detail) lightChosen();
    else lightAgain();
  });

  accounting.addEventListener("counted", ({ detail }) => {
    if (robot.picked) robot.askWhy(); // a person has picked which, perhaps another one than this
    else robot.about(detail);
    if (!foretelling && !litElsewhere()) lightChosen();
  });

  accounting.addEventListener("cancel", async ({ detail }) => {
    try {
      await wire.ask("cancel", detail ? { by: detail } : {});
    } catch (error) {
      refused(error);
    }
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

  function choose(index, name) {
    robot.choose(index, name);
    table.setChosen(index);
  }

  world.addEventListener("moved", () => legend.followed(world.flock !== null));

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

  world.addEventListener("turnover", ({ detail }) => {
    table.setNames(world.scene.names);
    selecting.forget(detail);
  });

  table.addEventListener("choose", ({ detail }) => world.choose(detail));
  glance.addEventListener("choose", ({ detail }) => world.choose(detail));
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

  // ---- the view in three dimensions

  if (!embedded) new Space(document.querySelector(".space"), find("space"), world, refused); // a cell's frame fetches nothing

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

  // ---- the timeline

  timeline.addEventListener("jump", () => {
    world.forgetTrails();
    for (const asking of [senses, sight, field]) asking.jump();
  });
  timeline.addEventListener("turned", () => mission.setElsewhere(timeline.elsewhere));
  timeline.addEventListener("seen", () => robot.askWhy()); // what was true then, or is now
  timeline.addEventListener("mark", ({ detail }) => {
    marked = detail.command; // its line is there when the news of then have come
  });

  // ---- what the page is given

  const actions = [
    ["Back to live", "F8", () => timeline.toLive()],
    ["New run: scenario, robots, seed", "", () => find("renew").hidden || press("renew")],
    ["Play the mission", "the scenario's commands at their times", () => find("mission").hidden || mission.find("play-mission").click()],
    ["Save as a test", "commands and what came of them", () => press("as-test")],
    ...(embedded ? [] : [["View in three dimensions on or off", "V", () => press("space")]]),
    ["Select robots with a lasso", "L", () => press("lasso")],
    ["Select the highlighted robots", "S", () => press("select-lit")],
    ["Type a sentence, or an expression again", "Ctrl+;", () => sentence.toggle()],
  ];

  function goTo(x, y) {
    follow(false);
    world.look(x, y);
  }

  const finds = {
    first: [() => prompt.ready.map(({ title, text }) => ({ kind: "command", title, hint: text, run: () => prompt.set(text) }))],
    then: [
      () => groups.map(({ name, count }) => ({ kind: "group", title: name, hint: `${count.toLocaleString("en")} robots`, run: () => prompt.set(`(WHEN (IN ${name}) )`) })),
      () => [...(world.scene?.places ?? []), ...(world.scene?.lights ?? [])].map(({ name, x, y }) => ({ kind: "place", title: name, run: () => goTo(x, y) })),
      () => [...prompt.history.items].reverse().map((text) => ({ kind: "earlier", title: text.replace(/\s+/g, " "), run: () => prompt.set(text) })),
    ],
  };

  return {
    robot,
    senses,
    layers: SWARM_LAYERS,
    trails: "trails",
    actions,
    finds,
    greet,
    show,
    choose,
    refused,
    legend: () => legend.lines(),
    recolour: () => {
      field.recolour();
      relief.recolour();
      sensors.draw();
      plots.recolour();
      radio.recolour();
      drawLegend();
    },
    focus: () => prompt.focus(),
    key: () => false,
  };
}

// Whether a world needs height more than width. On the air it may become another one with every robot that drives away.
function isUpright([left, bottom, right, top]) {
  return right - left < UPRIGHT * (top - bottom);
}
