// Trails: where every robot was in the last seconds, drawn on a canvas of their own a few times a second.

const DEPTH = 15; // samples kept of each robot
const EVERY = 180; // ms between samples
const BANDS = [0.42, 0.22, 0.1]; // opacity, youngest to oldest
const MAX_LINES = 2000; // in space, where software takes 5 us for each; many robots have fewer and longer ones, of fewer samples
const MAX = 5000; // robots; beyond, trails would only be a fog
const LEAP = 3; // times as much time as was wanted has passed: a slider was moved, and nobody drove there

export class Trails {
  constructor() {
    this.samples = []; // youngest first: x, y of every robot in turn, and z of each where robots have heights, else null
    this.last = 0;
  }

  // Keep the frame's positions if it is time to; whether it was.
  sample(frame, now) {
    if (frame.count > MAX || now - this.last < EVERY) return false;
    const [latest] = this.samples;
    if (latest?.tick === frame.tick) return false;
    if (latest && (latest.xy.length !== 2 * frame.count || this.leapt(latest, frame, now))) this.samples = [];
    this.last = now;
    const reused = this.samples.length >= DEPTH ? this.samples.pop() : { xy: new Float32Array(2 * frame.count) };
    for (let i = 0; i < frame.count; i += 1) {
      const aside = Number.isNaN(frame.poses[3 * i + 2]); // nobody drives from there; no line leads to NaN
      reused.xy[2 * i] = aside ? NaN : frame.poses[3 * i];
      reused.xy[2 * i + 1] = aside ? NaN : frame.poses[3 * i + 1];
    }
    Object.assign(reused, { z: frame.heights?.slice() ?? null, tick: frame.tick, time: frame.time, wanted: frame.wanted });
    this.samples.unshift(reused);
    return true;
  }

  // Other robots are at these places than before.
  forget(places) {
    for (const { xy } of this.samples) for (const place of places) xy.fill(NaN, 2 * place, 2 * place + 2);
  }

  // Whether time has gone back since the latest sample, or farther than it runs.
  leapt(latest, frame, now) {
    const most = (LEAP * Math.max(latest.wanted, frame.wanted) * (now - this.last)) / 1000;
    return frame.tick < latest.tick || frame.time - latest.time > most;
  }

  // Draw all trails; each band of age and each colour is one stroke. inks: the place of each robot's colour among `colours`.
  // area: the world's left, bottom, right and top.
  draw(pen, view, inks, colours, area) {
    pen.lineWidth = 1; // software strokes what is wider ten times as long
    pen.lineJoin = "round";
    const perBand = Math.ceil(DEPTH / BANDS.length);
    for (let band = BANDS.length - 1; band >= 0; band -= 1) {
      const run = this.samples.slice(band * perBand, (band + 1) * perBand + 1);
      if (run.length < 2) continue;
      pen.globalAlpha = BANDS[band];
      colours.forEach((colour, ink) => {
        const path = this.path(run, view, inks, ink, area);
        if (!path) return;
        pen.strokeStyle = colour;
        pen.stroke(path);
      });
    }
    pen.globalAlpha = 1;
  }

  path(run, view, inks, ink, area) {
    let path = null;
    for (let i = 0; i < inks.length; i += 1) {
      if (inks[i] !== ink) continue;
      const x = view.toScreenX(run[0].xy[2 * i]);
      const y = view.toScreenY(run[0].xy[2 * i + 1]);
      if (x < -50 || y < -50 || x > view.width + 50 || y > view.height + 50) continue;
      path ??= new Path2D();
      path.moveTo(x, y);
      for (let k = 1; k < run.length; k += 1) {
        const [x, y] = [run[k].xy[2 * i], run[k].xy[2 * i + 1]];
        if (goesAround(run[k - 1].xy, run[k].xy, i, area)) path.moveTo(view.toScreenX(x), view.toScreenY(y));
        else path.lineTo(view.toScreenX(x), view.toScreenY(y));
      }
    }
    return path;
  }
}

// All trails as lines in space: {corners: x, y and z of both ends of each in turn; colours: red, green, blue and opacity of each
// end}. samples: youngest first. palette: red, green and blue of 1 of each ink.
export function trailLines(samples, inks, palette, area) {
  const step = Math.max(1, Math.ceil((inks.length * (samples.length - 1)) / MAX_LINES)); // samples from one end to the other
  const most = 2 * inks.length * Math.max(0, Math.floor((samples.length - 1) / step));
  const [corners, colours] = [new Float32Array(3 * most), new Float32Array(4 * most)];
  const perBand = Math.ceil(DEPTH / BANDS.length);
  let end = 0;
  for (let k = step; k < samples.length; k += step) {
    const opacity = BANDS[Math.min(BANDS.length - 1, Math.floor((k - 1) / perBand))];
    const [before, after] = [samples[k], samples[k - step]];
    for (let i = 0; i < inks.length; i += 1) {
      if (Number.isNaN(before.xy[2 * i] + after.xy[2 * i]) || goesAround(before.xy, after.xy, i, area)) continue;
      for (const { xy, z } of [before, after]) {
        corners.set([xy[2 * i], xy[2 * i + 1], z?.[i] ?? 0], 3 * end);
        colours.set([...palette[inks[i]], opacity], 4 * end);
        end += 1;
      }
    }
  }
  return { corners: corners.subarray(0, 3 * end), colours: colours.subarray(0, 4 * end) };
}

// Whether a robot left the area on one side, and came in opposite, between two samples.
export function goesAround(before, after, robot, [left, bottom, right, top]) {
  const dx = Math.abs(after[2 * robot] - before[2 * robot]);
  const dy = Math.abs(after[2 * robot + 1] - before[2 * robot + 1]);
  return dx > (right - left) / 2 || dy > (top - bottom) / 2;
}
