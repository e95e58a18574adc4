// The mission of a scenario: its commands with their times, what was sent of them, and what became of it. The run plays it;
// a page shows that, and may send a single command.

import { clock } from "./accounting.js";
import { make, write } from "./elements.js";
import { Refusal } from "./wire.js";

const IN_TIME = 1; // s by which a line may be sent off its time without a word about it
const FAR = "This page looks at the past. Go back to live (F8) to send anything.";

export class MissionPane extends EventTarget {
  // bar: the line above the prompt. root: the list of commands, which is made here.
  constructor(bar, wire) {
    super();
    this.wire = wire;
    this.bar = bar;
    this.find = (name) => bar.querySelector(`.${name}`);
    this.root = make("div", { className: "mission-pane" });
    this.list = make("ol");
    this.root.append(make("p", { className: "about" }, ABOUT), this.list);
    this.lines = [];
    this.elsewhere = false;
    this.find("play-mission").addEventListener("click", () => this.ask("play", { on: !this.news.playing }));
    this.find("show-mission").addEventListener("click", () => {
      this.dispatchEvent(new Event("open"));
      this.list.querySelector(".next")?.scrollIntoView({ block: "nearest" }); // a mission may have a thousand
    });
    this.find("anyway").addEventListener("click", () => this.ask("sendline", { line: this.news.problem, confirmed: true }));
    this.find("without").addEventListener("click", () => this.ask("skipline", { line: this.news.problem }));
    wire.addEventListener("mission", ({ detail }) => this.set(detail));
  }

  set(news) {
    const first = !this.news;
    this.news = news;
    this.bar.hidden = false;
    this.showBar();
    this.showLines();
    if (first) this.dispatchEvent(new Event("there"));
  }

  // Whether the page looks at another time, when nothing can be sent.
  setElsewhere(elsewhere) {
    this.elsewhere = elsewhere;
    if (this.news) this.set(this.news);
  }

  // ---- how far it is

  showBar() {
    const { lines, playing, problem, said, doubt } = this.news;
    const rest = lines.filter((line) => line.sent === null && !line.left_out);
    const sent = lines.filter((line) => line.sent !== null).length;
    write(this.find("how-far"), howFar(lines.length, sent, playing, rest, problem));
    write(this.find("counts"), unmet(lines));
    const play = this.find("play-mission");
    play.hidden = rest.length === 0 || problem >= 0;
    play.disabled = this.elsewhere;
    play.title = this.elsewhere ? FAR : PLAY;
    play.classList.toggle("on", playing);
    write(play, playing ? "Stop playing" : sent ? "Play the rest" : "Play the mission");
    this.find("problem").hidden = problem < 0 && !said;
    const where = problem < 0 ? "" : `Command ${problem + 1}, at ${clock(lines[problem].at)}, was not sent, and time stands still:\n`;
    write(this.find("why"), `${where}${said}`);
    this.find("anyway").hidden = !doubt;
    this.find("without").hidden = problem < 0;
    for (const name of ["anyway", "without"]) this.find(name).disabled = this.elsewhere;
  }

  tell(text, wrong = false) {
    const told = this.find("told");
    write(told, text);
    told.classList.toggle("wrong", wrong);
  }

  // ---- its commands

  showLines() {
    const { lines } = this.news;
    if (this.lines.length !== lines.length) {
      this.lines = lines.map((line, index) => this.makeLine(line, index));
      this.list.replaceChildren(...this.lines.map(({ element }) => element));
    }
    const next = this.news.problem >= 0 ? this.news.problem : lines.findIndex((line) => line.sent === null && !line.left_out);
    lines.forEach((line, index) => this.showLine(this.lines[index], line, index === next, index === this.news.problem));
  }

  makeLine(line, index) {
    const text = make("button", { type: "button", className: "text", title: line.sort ? "Put it into the prompt" : "", disabled: !line.sort });
    if (line.words) text.append(make("b", {}, line.words), " ");
    text.append(make("code", {}, line.text));
    text.addEventListener("click", () => this.dispatchEvent(new CustomEvent("put", { detail: line })));
    const [became, wanted, send] = [make("span", { className: "became" }), make("span", { className: "wanted" }), make("button", { type: "button", className: "send" })];
    send.addEventListener("click", () => this.send(index));
    const element = make("li", {}, make("time", {}, clock(line.at)), text, make("span", { className: "state" }, became, wanted), send);
    return { element, became, wanted, send, name: `command ${index + 1}, at ${clock(line.at)}` };
  }

  showLine({ element, became, wanted, send, name }, line, next, problem) {
    element.classList.toggle("sent", line.sent !== null);
    element.classList.toggle("next", next);
    if (next) element.setAttribute("aria-current", "step");
    else element.removeAttribute("aria-current");
    element.classList.toggle("trouble", problem);
    write(became, problem ? "waits for you" : stateOf(line));
    const key = JSON.stringify(line.wanted);
    if (wanted.dataset.key !== key) {
      wanted.dataset.key = key;
      wanted.replaceChildren(...line.wanted.map((each) => make("span", { className: each.number === null ? "" : each.met ? "met" : "unmet" }, countOf(each))));
    }
    write(send, line.sent === null ? "Send" : "Send again");
    send.setAttribute("aria-label", `${send.textContent}: ${name}`);
    send.disabled = this.elsewhere;
    send.title = this.elsewhere ? FAR : "";
  }

  // Send a line now. What is doubted must be sent once more.
  async send(index) {
    const confirmed = this.doubted === index;
    const again = this.news.lines[index].sent !== null;
    await this.ask("sendline", { line: index, again, confirmed }, index);
  }

  async ask(type, fields, index) {
    this.tell("");
    this.doubted = undefined; // a doubt is confirmed by the very next press, or not
    try {
      const { said } = await this.wire.ask(type, fields);
      this.tell(said);
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      if (refusal.doubt) this.doubted = index;
      this.tell(refusal.doubt ? refusal.message.replace(/\n[^\n]*$/, "\nPress Send once more to send it as it stands.") : refusal.message, true);
    }
  }
}

const ABOUT = "What the scenario's author would send, and when. Nothing of it is sent by itself: play all of it, or send single lines.";
const PLAY = "Send each command at its time of the run, and at once what is late. STOP ends it.";

function howFar(all, sent, playing, rest, problem) {
  const commands = `${all} command${all === 1 ? "" : "s"}`;
  if (problem >= 0) return `${sent} of ${commands} sent, and it waits for you.`;
  if (!rest.length) return sent === all ? `all ${commands} sent.` : `${sent} of ${commands} sent, the rest is left out.`;
  const next = `next at ${clock(rest[0].at)}`;
  if (playing) return `${sent} of ${commands} sent, ${next}.`;
  return sent ? `${sent} of ${commands} sent, and no more by itself.` : `${commands}, none is sent by itself.`;
}

function unmet(lines) {
  const counts = lines.flatMap((line) => line.wanted).filter((wanted) => wanted.number !== null && !wanted.met).length;
  return counts ? `${counts} count${counts === 1 ? " is" : "s are"} not as wanted yet.` : "";
}

function stateOf(line) {
  if (line.sent === null) return line.left_out ? "left out" : "not sent";
  return Math.abs(line.sent - line.at) > IN_TIME ? `sent at ${clock(line.sent)}` : "sent";
}

function countOf(wanted) {
  if (wanted.number === null) return `wanted: ${wanted.text}`;
  return wanted.met ? `✓ ${wanted.text}` : `✗ ${wanted.text}: ${wanted.number.toLocaleString("en")} now`;
}
