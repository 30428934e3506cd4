// Mouse, wheel and fingers on a disk: they move and zoom the picture, and take hold of things in a sandbox.

import { AIM } from "./draw.js";

const REACH = 24; // largest distance from the velocity's tip at which a press grasps it [px]

// `view` has `pan` and `zoom`. `grip` returns what one finger or the main button holds: {move, end}, or nothing.
export function followPointers(canvas, view, redraw, grip = () => null) {
  const pointers = new Map(),
    place = (event) => [event.offsetX, event.offsetY];
  let held = null;
  const letGo = (cancelled) => {
    held?.end?.(cancelled);
    held = null;
  };
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    letGo(true);
    pointers.set(event.pointerId, place(event));
    if (pointers.size === 1 && !event.button && !event.shiftKey) held = grip(...place(event));
  };
  canvas.onpointermove = (event) => {
    const before = pointers.get(event.pointerId),
      now = place(event);
    if (!before) return;
    pointers.set(event.pointerId, now);
    const other = [...pointers].find(([id]) => id !== event.pointerId)?.[1];
    const shift = [now[0] - before[0], now[1] - before[1]];
    if (other) {
      const distance = ([x, y]) => Math.max(Math.hypot(x - other[0], y - other[1]), 1);
      view.zoom(distance(now) / distance(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2);
      view.pan(shift[0] / 2, shift[1] / 2);
    } else if (held) held.move(...now);
    else view.pan(...shift);
    redraw();
  };
  canvas.onpointerup = canvas.onpointercancel = (event) => {
    pointers.delete(event.pointerId);
    letGo(event.type === "pointercancel");
  };
  canvas.oncontextmenu = (event) => event.preventDefault();
  canvas.onwheel = (event) => {
    event.preventDefault();
    view.zoom(1.12 ** (-event.deltaY / 60), ...place(event));
    redraw();
  };
}

// Return what a press at (px, py) holds: before the throw the disk, which turns, or its velocity; later a point.
export function grip(sandbox, px, py) {
  const { drawing, state, panel, send, plays, ui } = sandbox;
  if (!plays || !state) return null;
  const { com_x: cx, com_y: cy, com_vx, com_vy } = state.row,
    world = (...at) => drawing.toWorld(...at);
  const [x0, y0] = world(px, py);
  if (!panel.atStart || ui.arrow.disabled) return pull(sandbox, px, py);
  const aim = (fromX, fromY) => ({
    move: (...at) => send({ do: "aim", dx: world(...at)[0] - fromX, dy: world(...at)[1] - fromY }),
    end: (cancelled) => send({ do: cancelled ? "release" : "throw" }),
  });
  const [tipX, tipY] = drawing.toScreen(cx + com_vx / AIM, cy + com_vy / AIM);
  if (ui.arrow.checked && Math.hypot(tipX - px, tipY - py) < REACH) return aim(cx, cy);
  const distances = Array.from(drawing.scene.outline, (i) =>
    Math.hypot(state.x[2 * i] - cx, state.x[2 * i + 1] - cy),
  );
  if (Math.hypot(x0 - cx, y0 - cy) > Math.max(...distances)) return aim(x0, y0);
  let angle = 0;
  return {
    move(...at) {
      const [x, y] = world(...at);
      angle = Math.atan2(y - cy, x - cx) - Math.atan2(y0 - cy, x0 - cx);
      send({ do: "turn", angle, final: 0 });
    },
    end: (cancelled) => angle && send({ do: "turn", angle: cancelled ? 0 : angle, final: 1 }),
  };
}

function pull(sandbox, px, py) {
  const move = (...at) => {
    const [x, y] = (sandbox.target = sandbox.drawing.toWorld(...at));
    sandbox.send({ do: "pull", x, y });
  };
  const end = () => {
    sandbox.target = null;
    sandbox.send({ do: "release" });
  };
  move(px, py);
  return { move, end };
}
