// A picture under the world: that of the scenario's map, or one that somebody chooses, which stays in this browser. How much of
// it is seen, where it lies and how large its pixels are is remembered for each scenario.

import { bytes } from "./accounting.js";
import { keep, kept } from "./kept.js";
import { keepPicture, keptPicture } from "./store.js";
import { Refusal } from "./wire.js";

const TYPES = ["image/png", "image/jpeg", "image/webp"]; // no SVG: that is a document
const MAX_BYTES = 16777216; // of a file
const MAX_PIXELS = 16777216;
const PATIENCE = 60000; // ms: a large map is packed anew by the station
const NUMBERS = ["x", "y", "resolution"]; // of its place: the lower left corner, m, and the side of a pixel, m
const LEAST = { x: -1e7, y: -1e7, resolution: 1e-4 };
const GREATEST = 1e7;

export class GroundPicture {
  // menu: the element with the fields. undo: as of undo.js.
  constructor(menu, world, wire, undo) {
    this.world = world;
    this.wire = wire;
    this.undo = undo;
    this.find = (name) => menu.querySelector(`.${name}`);
    this.title = null; // of the scene
    this.image = null; // an ImageBitmap
    this.own = false; // whether somebody has chosen it
    this.opacity = 0.6;
    this.place = null; // {x, y, yaw, resolution}
    this.asked = 0;
    world.under = this;
    this.find("choose").addEventListener("click", () => this.find("file").click());
    this.find("file").addEventListener("change", ({ target }) => {
      if (target.files.length) this.choose(target.files[0]);
      target.value = "";
    });
    this.find("remove").addEventListener("click", () => this.remove());
    this.find("opacity").addEventListener("input", ({ target }) => this.set({ opacity: target.valueAsNumber / 100 }));
    for (const name of NUMBERS) this.find(name).addEventListener("change", ({ target }) => this.move(name, target.valueAsNumber));
    this.show();
  }

  // Another scene may have another picture.
  async setScene(scene) {
    if (scene.title === this.title) return;
    this.title = scene.title;
    this.put(null, false, null);
    const number = (this.asked += 1);
    const blob = await keptPicture(this.title);
    const [image, own] = blob ? [await decoded(blob), true] : [await this.ofScenario(scene), false];
    if (image && number === this.asked) this.put(image, own, own ? null : scene.picture);
  }

  async ofScenario(scene) {
    if (!scene.picture) return null;
    try {
      const { png } = await this.wire.ask("picture", {}, PATIENCE);
      return await decoded(new Blob([bytes(png)], { type: "image/png" }));
    } catch (refusal) {
      if (!(refusal instanceof Refusal)) throw refusal;
      this.say(refusal.message);
      return null;
    }
  }

  // ---- what people do

  async choose(file) {
    const number = (this.asked += 1);
    if (!TYPES.includes(file.type)) this.say("Choose a picture in PNG, JPEG or WebP.");
    else if (file.size > MAX_BYTES) this.say(`That file has ${file.size.toLocaleString("en")} bytes; at most ${MAX_BYTES.toLocaleString("en")} fit.`);
    else {
      const image = await decoded(file);
      if (number !== this.asked) return;
      if (!image) this.say(`That is no picture that can be read, or it has more than ${MAX_PIXELS.toLocaleString("en")} pixels.`);
      else {
        keep(this.key, null); // the place of the one before
        this.put(image, true, null);
        await keepPicture(this.title, file);
      }
    }
  }

  // The one of the scenario is shown again, if there is one.
  async remove() {
    const number = (this.asked += 1);
    await keepPicture(this.title, null);
    keep(this.key, null);
    this.put(null, false, null);
    const { scene } = this.world;
    const image = await this.ofScenario(scene);
    if (image && number === this.asked) this.put(image, false, scene.picture);
  }

  move(name, value) {
    const before = { ...this.place };
    if (!(value >= LEAST[name] && value <= GREATEST)) {
      this.say(`Wanted a number from ${LEAST[name]} to ${GREATEST}.`);
      this.find(name).value = before[name];
      return;
    }
    const { image } = this;
    const put = (place) => this.image === image && this.set({ place });
    put({ ...before, [name]: value });
    this.undo.did("move the picture", () => put(before), () => put({ ...before, [name]: value }));
  }

  // ---- what is shown

  get key() {
    return `picture.${this.title}`;
  }

  // place: where it lies; null where people say that.
  put(image, own, place) {
    this.image?.close();
    const known = kept(this.key, null) ?? {};
    const [left, bottom, right] = this.world.scene?.area ?? [0, 0, 1];
    this.image = image;
    this.turned = null; // its negative, once that was wanted
    this.own = own;
    this.opacity = known.opacity ?? 0.6;
    this.place = place ?? known.place ?? { x: left, y: bottom, yaw: 0, resolution: (right - left) / (image?.width ?? 1) };
    this.show();
    this.world.repaint("ground");
  }

  set(changes) {
    Object.assign(this, changes);
    keep(this.key, { opacity: this.opacity, ...(this.own ? { place: this.place } : {}) });
    this.show();
    this.world.repaint("ground");
  }

  show() {
    this.find("seen").hidden = !this.image;
    this.find("of-place").hidden = !this.own;
    this.find("choose").textContent = this.own ? "Choose another picture" : "Choose a picture";
    this.find("opacity").value = Math.round(100 * this.opacity);
    for (const name of NUMBERS) this.find(name).value = Number((this.place?.[name] ?? 0).toPrecision(9));
    this.say("");
  }

  say(text) {
    this.find("said").hidden = !text;
    this.find("said").textContent = text;
  }

  // A map is dark walls on white, which would dazzle, and hide the robots, in the dark.
  get negative() {
    this.turned ??= negativeOf(this.image);
    return this.turned;
  }

  draw(pen, view) {
    if (!this.image || !this.world.shows("picture")) return;
    const { x, y, yaw, resolution } = this.place;
    const side = resolution * view.scale; // pixels of the screen for one of the picture
    pen.save();
    pen.globalAlpha = this.opacity;
    pen.imageSmoothingEnabled = side < 2; // from close by, the cells of a map have edges
    pen.translate(view.toScreenX(x), view.toScreenY(y));
    pen.rotate(-yaw);
    const { width, height } = this.image;
    pen.drawImage(this.own || !isDark(this.world.colours.ground) ? this.image : this.negative, 0, -height * side, width * side, height * side);
    pen.restore();
  }
}

function negativeOf(image) {
  const sheet = Object.assign(document.createElement("canvas"), { width: image.width, height: image.height });
  const pen = sheet.getContext("2d");
  pen.drawImage(image, 0, 0);
  pen.globalCompositeOperation = "difference";
  pen.fillStyle = "#fff";
  pen.fillRect(0, 0, image.width, image.height);
  return sheet;
}

function isDark(colour) {
  const [red, green, blue] = [1, 3, 5].map((at) => Number.parseInt(colour.slice(at, at + 2), 16));
  return red + green + blue < 384;
}

// The picture in a file, null for what is none or too large.
async function decoded(blob) {
  try {
    const image = await createImageBitmap(blob);
    if (image.width * image.height <= MAX_PIXELS) return image;
    image.close();
    return null;
  } catch {
    return null;
  }
}
