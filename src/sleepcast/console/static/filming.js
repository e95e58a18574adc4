// The map as a file: a picture (PNG) of what is seen, and a film (WebM) of what comes, both with the legend, the scale and the
// time. The page makes them itself, from its own canvases.

import { download } from "./files.js";
import { drawLabel } from "./ground.js";
import { font } from "./type.js";
import { picture } from "./shapes.js";
import { gridStep } from "./view.js";

const FRAMES = 30; // of a film in a second
const LONGEST = 600; // seconds of one film: it is held in memory until it is saved
const TYPES = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm"];
const LINE = 21; // pixels from one line of the legend to the next

export class Filming {
  // buttons: {picture, film}. time: gives the time as it is shown. lines: gives the legend's lines. said: called with a
  // sentence when something could not be done.
  constructor(world, buttons, time, lines, said) {
    this.world = world;
    this.buttons = buttons;
    this.time = time;
    this.lines = lines;
    this.said = said;
    this.recorder = null;
    this.sheet = document.createElement("canvas");
    buttons.picture.addEventListener("click", () => this.save());
    buttons.film.addEventListener("click", () => (this.recorder ? this.recorder.stop() : this.begin()));
  }

  save() {
    this.compose();
    this.sheet.toBlob((blob) => download(`${this.name}.png`, "image/png", [blob]), "image/png");
  }

  begin() {
    const mimeType = TYPES.find((type) => window.MediaRecorder?.isTypeSupported(type));
    if (!mimeType) {
      this.said("This browser cannot make films. The picture of the map can be saved.");
      return;
    }
    this.compose();
    const { name } = this;
    const parts = [];
    const recorder = new MediaRecorder(this.sheet.captureStream(FRAMES), { mimeType });
    recorder.addEventListener("dataavailable", ({ data }) => {
      if (data.size) parts.push(data);
      if (this.recorder) this.show(parts.reduce((sum, { size }) => sum + size, 0));
    });
    recorder.addEventListener("stop", () => {
      clearTimeout(this.timer);
      this.recorder = null;
      this.show();
      if (parts.length) download(`${name}.webm`, "video/webm", parts);
      else this.said("The film was stopped before its first picture.");
    });
    this.recorder = recorder;
    this.timer = setTimeout(() => recorder.stop(), 1000 * LONGEST);
    recorder.start(1000);
    this.show();
    this.film();
  }

  // One picture of the film, and the next ones: also while no robot moves, a film goes on.
  film() {
    if (!this.recorder) return;
    this.compose();
    requestAnimationFrame(() => this.film());
  }

  // bytes: of the film so far.
  show(bytes = 0) {
    const on = this.recorder !== null;
    const size = bytes ? ` (${Math.ceil(bytes / 1000).toLocaleString("en")} kB)` : "";
    this.buttons.film.setAttribute("aria-pressed", String(on));
    this.buttons.film.querySelector("span").textContent = on ? `Stop and save the film${size}` : "Film the map (WebM)";
    this.world.map.classList.toggle("filming", on);
  }

  get name() {
    const title = this.world.scene.title.replace(/[^\p{L}\p{N}]+/gu, "-").replace(/^-|-$/g, "").toLowerCase();
    return `${title || "map"}-${this.time().replaceAll(":", ".")}`;
  }

  // Draw the map as it is seen onto the sheet. A film keeps the size with which it began.
  compose() {
    const { world, sheet } = this;
    const { pens, view, colours, ratio } = world;
    const { width, height } = pens.ground.canvas;
    if (!this.recorder && (sheet.width !== width || sheet.height !== height)) [sheet.width, sheet.height] = [width, height];
    const pen = sheet.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    for (const name of ["ground", "trails", "robots"]) pen.drawImage(pens[name].canvas, 0, 0, sheet.width, sheet.height);
    pen.setTransform((ratio * sheet.width) / width, 0, 0, (ratio * sheet.height) / height, 0, 0);
    this.lines().forEach(({ look, count, text }, line) => {
      const y = 18 + LINE * line;
      if (look !== undefined) pen.drawImage(picture(look, colours), 10, y - 9.5, 18, 18);
      drawLabel(pen, view, `${count.toLocaleString("en")} ${text}`, 34, y, colours.ink, colours.area, font(13), []);
    });
    const step = gridStep(view, world.scene.unit, 140);
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 1.2;
    pen.beginPath();
    pen.moveTo(12, view.height - 20);
    pen.lineTo(12, view.height - 14);
    pen.lineTo(12 + step.metres * view.scale, view.height - 14);
    pen.lineTo(12 + step.metres * view.scale, view.height - 20);
    pen.stroke();
    const caption = `${step.label}     ${this.time()}`;
    drawLabel(pen, view, caption, 20 + step.metres * view.scale, view.height - 16, colours.ink, colours.area, font(13), []);
  }
}
