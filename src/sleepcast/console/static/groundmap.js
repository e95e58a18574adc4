// How high the ground of a ground map is.

// m above the origin, at a place. area: the world's left, bottom, right and top. map: {columns, rows, heights: m, row by row from
// the bottom, from edge to edge of the area}; null where the ground is flat.
export function groundAt([left, bottom, right, top], map, x, y) {
  if (!map) return 0;
  const { columns, rows, heights } = map;
  const [column, across] = between((x - left) / (right - left), columns);
  const [row, up] = between((y - bottom) / (top - bottom), rows);
  const [low, high] = [row, row + 1].map((each) => {
    const first = heights[each * columns + column];
    return first + across * (heights[each * columns + column + 1] - first);
  });
  return low + up * (high - low);
}

// Between which two of so many points a share of the way along a side lies: the first one, and the share of the way to the next.
function between(share, count) {
  const place = Math.max(0, Math.min(1, share)) * (count - 1);
  const first = Math.min(count - 2, Math.floor(place));
  return [first, place - first];
}
