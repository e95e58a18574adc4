// Binary frames from the station, as console/frames.py lays them out (little endian).

export const EXHAUSTED = 32; // it has used up what it drives with
export const CRASHED = 64;
export const STILL = 1 | 2 | 4 | EXHAUSTED | CRASHED; // any of the flags that hold a body still
export const MARKED = 8; // its light shows its mark
export const SILENT = 16; // what it told is old
export const FLAG_NAMES = ["stopped", "frozen", "sleeping", "marked", "silent"]; // by bit


// What people call a colour by its number in a frame.
export const colourName = (number) => (number === 255 ? "another colour" : `colour ${number}`);

const HEADER = 32;

// One frame: {running, stopped, preparing, waiting, count, number, tick, time, wanted, achieved, poses, heights, groups, flags,
// pings, second, colours} with poses as x, y (m) and heading (rad) of every robot in turn, time in simulated seconds. Heights and
// the last three are null where nobody has one, else they hold for each robot: z (m), its caste + 1 or 0, its second group or 0,
// its colour or 0.
// before: the frame before, whose robots a short one repeats.
export function decode(buffer, before) {
  const view = new DataView(buffer);
  const state = view.getUint8(1);
  const count = view.getUint32(4, true);
  const follow = view.getUint8(2);
  const header = {
    running: (state & 1) !== 0,
    stopped: (state & 2) !== 0,
    preparing: (state & 4) !== 0,
    waiting: (state & 8) !== 0,
    count,
    number: view.getUint32(8, true),
    tick: view.getUint32(12, true),
    time: view.getFloat64(16, true),
    wanted: view.getFloat32(24, true),
    achieved: view.getFloat32(28, true),
  };
  if (view.getUint8(3) === 1) return { ...before, ...header, pings: null };
  let end = HEADER + 12 * count;
  const heights = follow & 8 ? new Float32Array(buffer, (end += 4 * count) - 4 * count, count) : null;
  const column = (there) => (there ? new Uint8Array(buffer, (end += count) - count, count) : null);
  return {
    ...header,
    poses: new Float32Array(buffer, HEADER, 3 * count),
    heights,
    groups: column(true),
    flags: column(true),
    pings: column(follow & 1),
    second: column(follow & 2),
    colours: column(follow & 4),
  };
}
