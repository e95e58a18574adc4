// What hands do on a map: drag, click, pinch, turn the wheel. Pixels are of the map's own box.
//
// handlers: drag(dx, dy), click(x, y, event), hover(x, y, touch) with null for both when the pointer is gone, touch: whether it
// is a finger; zoom(factor, x, y).
// Where things can be taken hold of, grab(x, y, event) gives {move(x, y), drop(moved)} for what lies there, or null; where two
// clicks may follow each other fast and mean no closer look, busy() says so.

const DRAG = 4; // pixels: what moves less is a click
const DOUBLE = 1.96; // what a double click zooms by

export function gestures(map, handlers) {
  const pointers = new Map();
  let travelled = 0;
  let held = null;
  const place = (event) => {
    const box = map.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  const touch = (event) => event.pointerType === "touch";
  const letGo = (moved) => {
    held?.drop(moved);
    held = null;
  };
  map.addEventListener("pointerdown", (event) => {
    if (event.button !== 0) return;
    map.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, place(event));
    handlers.hover(...place(event), touch(event));
    if (pointers.size === 1) {
      travelled = 0;
      held = handlers.grab?.(...place(event), event) ?? null;
    } else letGo(false); // a second finger means the map
  });
  map.addEventListener("pointermove", (event) => {
    const now = place(event);
    const before = pointers.get(event.pointerId);
    if (!before) {
      handlers.hover(...now, touch(event));
      return;
    }
    const [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    travelled += Math.hypot(dx, dy);
    if (pointers.size === 2) pinch(pointers, event.pointerId, before, now, handlers.zoom);
    else if (travelled > DRAG) {
      if (held) held.move(...now);
      else handlers.drag(dx, dy);
    }
    handlers.hover(...now, touch(event));
    pointers.set(event.pointerId, now);
    map.classList.toggle("dragging", travelled > DRAG);
  });
  const release = (event) => {
    if (!pointers.delete(event.pointerId)) return;
    const up = event.type === "pointerup";
    letGo(up && travelled > DRAG);
    if (up && travelled <= DRAG) handlers.click(...place(event), event);
    map.classList.remove("dragging");
  };
  map.addEventListener("pointerup", release);
  map.addEventListener("pointercancel", release);
  map.addEventListener("pointerleave", (event) => handlers.hover(null, null, touch(event)));
  map.addEventListener("dblclick", (event) => {
    if (!handlers.busy?.()) handlers.zoom(DOUBLE, ...place(event));
  });
  map.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const lines = event.deltaMode === 1 ? 30 : 1;
      const amount = Math.max(-240, Math.min(240, event.deltaY * lines));
      handlers.zoom(Math.exp(-amount * (event.ctrlKey ? 0.01 : 0.0022)), ...place(event));
    },
    { passive: false },
  );
}

function pinch(pointers, id, before, now, zoom) {
  const [other] = [...pointers].filter(([key]) => key !== id).map(([, at]) => at);
  const gap = (at) => Math.max(1, Math.hypot(at[0] - other[0], at[1] - other[1]));
  zoom(gap(now) / gap(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
}
