// The page of an experiment: what the sweep has found so far, and links to its runs.

import { showLine } from "../line.js";
import { theme } from "../theme.js";
import { admitted, socket } from "../token.js";
import { Refusal, Wire } from "../wire.js";
import { Chart, sign } from "./chart.js";
import { short } from "../scales.js";

const find = (id) => document.getElementById(id);
const wire = new Wire(() => new WebSocket(socket()));
const chart = new Chart(find("chart"), find("tip"));
let measures = {}; // what each name means
let chosen = null; // the point whose runs are listed: {name, mark}

// ---- from the server

showLine(wire, find("offline"), "the sweep");

wire.addEventListener("hello", ({ detail }) => {
  const name = detail.scenario.split("/").pop();
  find("title").textContent = detail.goal ? `${name}: ${detail.goal}` : name;
  document.title = `${name} · experiment · sleepcast`;
  find("folder").textContent = detail.folder;
  find("notes").replaceChildren(
    ...(detail.notes ?? []).map((note) => Object.assign(document.createElement("li"), { textContent: `${note}.` })),
  );
  measures = detail.measures;
  for (const axis of ["x", "y", "by"]) offer(find(axis), detail[axis]);
  find("by-label").hidden = detail.by.length < 2;
  look();
});

wire.addEventListener("come", ({ detail: { progress } }) => {
  const { total, done, failed, unknown, kept, state } = progress;
  const number = (value) => value.toLocaleString("en");
  find("bar").value = total ? done / total : 0;
  const parts = [`${number(done)} of ${number(total)} runs done`];
  if (failed) parts.push(`${number(failed)} failed`);
  if (unknown) parts.push(`${number(unknown)} values unknown`);
  if (kept < done) parts.push(`curves of the first ${number(kept)}`);
  find("counts").textContent = parts.join(", ");
  find("rest").textContent = state === "finished" ? "finished" : progress.rest === null ? "" : `${span(progress.rest)} left`;
  find("errors").replaceChildren(
    ...progress.errors.map(([words, count]) =>
      Object.assign(document.createElement("li"), { textContent: count > 1 ? `${words} (${number(count)} runs)` : words }),
    ),
  );
});

wire.addEventListener("drawing", ({ detail }) => {
  if (detail.x !== find("x").value || detail.y !== find("y").value) return; // of what was chosen before
  const { curves } = detail.found;
  find("nothing").hidden = curves.some((curve) => curve.marks.length > 0);
  chart.show(detail);
  find("legend").replaceChildren(
    ...(detail.by ? curves : []).map((curve, index) => {
      const line = document.createElement("li");
      line.append(sign(index), `${detail.by} = ${curve.name}`);
      return line;
    }),
  );
  const { hidden } = detail.found;
  if (hidden) {
    const words = hidden === 1 ? "1 curve is not shown whole" : `${hidden.toLocaleString("en")} curves are not shown whole`;
    find("legend").append(Object.assign(document.createElement("li"), { textContent: `${words}: there are too many points` }));
  }
});

// ---- to the server

function offer(list, choices) {
  const before = list.value;
  list.replaceChildren(...choices.map((choice) => new Option(choice || "nothing", choice)));
  if (choices.includes(before)) list.value = before;
}

function look() {
  const [x, y] = [find("x").value, find("y").value];
  if (find("by").value === x) find("by").value = "";
  for (const option of find("by").options) option.disabled = option.value === x && x !== "";
  find("meaning").textContent = `${y}: ${measures[y]}.`;
  wire.tell("look", { x, y, by: find("by").value });
  choose(null);
}

for (const axis of ["x", "y", "by"]) find(axis).addEventListener("change", look);

function choose(point) {
  chosen = point;
  chart.choose(point?.key ?? "");
  find("point").hidden = point === null;
  find("no-point").hidden = point !== null;
}

chart.addEventListener("choose", async ({ detail }) => {
  choose(detail);
  find("point-text").textContent = chart.words(detail);
  find("value-name").textContent = find("y").value;
  try {
    const { runs } = await wire.ask("runs", { x: detail.mark.x, name: detail.name });
    if (chosen === detail) find("runs").replaceChildren(...runs.map(row));
  } catch (refusal) {
    if (!(refusal instanceof Refusal)) throw refusal;
    find("point-text").textContent = refusal.message;
  }
});

function row(run) {
  const link = Object.assign(document.createElement("a"), { textContent: `Open run ${run.number}`, target: "_blank", rel: "noopener" });
  link.href = admitted("run", { number: run.number }).href;
  const line = document.createElement("tr");
  const cell = (content, kind = "") => {
    const made = Object.assign(document.createElement("td"), { className: kind });
    made.append(content);
    line.append(made);
  };
  cell(link);
  cell(String(run.seed));
  if (run.error) cell(run.error, "failed");
  else cell(run.value === null ? "unknown" : short(run.value));
  cell(Object.entries(run.settings).map(([key, value]) => `${key} = ${value}`).join(", "));
  return line;
}

// A time that is left, in one unit or two.
function span(seconds) {
  if (seconds < 60) return `${Math.ceil(seconds)} s`;
  if (seconds < 3600) return `${Math.round(seconds / 60)} min`;
  return `${Math.floor(seconds / 3600)} h ${Math.round((seconds % 3600) / 60)} min`;
}

theme(find("theme"), () => {});
