// The alternate run: where its robots were as small rings.

const SAME = 3; // pixels between a robot and its ring, below which the ring would only hide it
const MAX_RINGS = 20000; // more are points

// Positions from the station's bytes (console/frames.py): x, y (m) and heading of each robot in turn.
export function alternatePoses(buffer) {
  const count = new DataView(buffer).getUint32(4, true);
  return count ? new Float32Array(buffer, 8, 3 * count) : null;
}

// Draw those that are not where the robots are now (poses as in a frame).
export function drawAlternate(pen, view, poses, now) {
  const count = Math.min(poses.length, now.length) / 3;
  const colour = getComputedStyle(document.documentElement).getPropertyValue("--alternate").trim();
  pen.strokeStyle = colour;
  pen.fillStyle = colour;
  pen.lineWidth = 1.5;
  pen.beginPath();
  for (let i = 0; i < count; i += 1) {
    const x = view.toScreenX(poses[3 * i]);
    const y = view.toScreenY(poses[3 * i + 1]);
    if (x < -5 || y < -5 || x > view.width + 5 || y > view.height + 5) continue;
    if (Math.hypot(x - view.toScreenX(now[3 * i]), y - view.toScreenY(now[3 * i + 1])) < SAME) continue;
    if (count > MAX_RINGS) pen.fillRect(x - 1, y - 1, 2, 2);
    else {
      pen.moveTo(x + 4, y);
      pen.arc(x, y, 4, 0, 2 * Math.PI);
    }
  }
  pen.stroke();
}
