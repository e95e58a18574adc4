// Polygons.

// Whether a polygon (x and y of its corners in turn) encloses a point, by an odd number of its sides to the right of it.
export function encloses(polygon, x, y) {
  let inside = false;
  let fromX = polygon.at(-2);
  let fromY = polygon.at(-1);
  for (let at = 0; at < polygon.length; at += 2) {
    const toX = polygon[at];
    const toY = polygon[at + 1];
    if (fromY > y !== toY > y && x < ((toX - fromX) * (y - fromY)) / (toY - fromY) + fromX) inside = !inside;
    [fromX, fromY] = [toX, toY];
  }
  return inside;
}
