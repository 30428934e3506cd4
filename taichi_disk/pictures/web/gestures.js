// Mouse, wheel and fingers on a disk: they move and zoom the picture, and take hold of things in a
// sandbox.

import { arrowLength, arrowSpeed } from "./draw.js";

const AIM_SCALE = 0.05; // velocity for which the program takes an aim as long as R [c/R]
const PLACES = 60; // along an outline that is drawn
const REACH = 24; // largest distance from the velocity's tip at which a press grasps it [px]

// `view` has `pan` and `zoom`. `grip` returns what one finger or the main button holds:
// {move, end}, or nothing.
export function followPointers(canvas, view, redraw, grip = () => null) {
  const pointers = new Map();
  const place = (event) => [event.offsetX, event.offsetY];
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
    const before = pointers.get(event.pointerId);
    const now = place(event);
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

// Return what a press at (px, py) holds: before the throw the disk, which turns, or its velocity;
// later a point.
export function grip(sandbox, px, py) {
  const { drawing, state, panel, ui } = sandbox;
  if (!state) return null;
  if (sandbox.isSketching) return drawBody(sandbox);
  if (!panel.atStart || ui.arrow.disabled) return pull(sandbox, px, py);
  const { com_x: x, com_y: y, com_vx: vx, com_vy: vy } = state.row;
  const speed = Math.hypot(vx, vy);
  const length = arrowLength(speed) / speed;
  const [tipX, tipY] = drawing.toScreen(x + length * vx, y + length * vy);
  const isAtTip = Math.hypot(tipX - px, tipY - py) < REACH;
  if (ui.arrow.checked && isAtTip) return aim(sandbox, x, y);
  const [pressedX, pressedY] = drawing.toWorld(px, py);
  const distance = (i) => Math.hypot(state.x[2 * i] - x, state.x[2 * i + 1] - y);
  const radius = Math.max(...Array.from(drawing.scene.outline, distance));
  if (Math.hypot(pressedX - x, pressedY - y) > radius) return aim(sandbox, pressedX, pressedY);
  return turn(sandbox, pressedX, pressedY);
}

// Draw the outline of a body, at whose end it is sent as the path of an SVG, whose y points down.
function drawBody(sandbox) {
  return {
    move: (...at) => sandbox.stroke.push(sandbox.drawing.toWorld(...at)),
    end(cancelled) {
      const stroke = smoothed(sandbox.stroke);
      sandbox.sketch(cancelled); // after a second finger, or a gesture of the system, it is drawn anew
      if (cancelled || stroke.length < 3) return;
      sandbox.stroke = stroke;
      const corners = stroke.map(([x, y]) => `${x.toFixed(3)} ${(-y).toFixed(3)}`);
      sandbox.send({ do: "outline", path: `M${corners.join("L")}Z` });
    },
  };
}

// Return evenly spaced places along a closed stroke, without what it goes on beyond its start, and
// without the trembling of a hand.
export function smoothed(stroke) {
  const distance = ([x, y], [otherX, otherY]) => Math.hypot(x - otherX, y - otherY);
  const along = [0];
  for (let k = 1; k < stroke.length; k++)
    along.push(along[k - 1] + distance(stroke[k - 1], stroke[k]));
  const length = along.at(-1);
  const near = stroke.map((place, k) => (along[k] > 0.8 * length ? distance(place, stroke[0]) : length));
  const last = near.indexOf(Math.min(...near));
  const ring = near[last] < 0.1 * length ? stroke.slice(0, last + 1) : stroke;
  if (!length) return [];
  ring.push(stroke[0]);
  const turns = ring.map((place, k) => (k ? distance(ring[k - 1], place) : 0));
  const total = turns.reduce((sum, part) => sum + part);
  const places = [];
  let k = 0;
  let walked = 0; // up to the corner k
  for (let i = 0; i < PLACES; i++) {
    const goal = (total * i) / PLACES;
    while (walked + turns[k + 1] < goal) walked += turns[++k];
    const part = (goal - walked) / turns[k + 1] || 0;
    places.push([0, 1].map((c) => ring[k][c] + part * (ring[k + 1][c] - ring[k][c])));
  }
  const mean = (k, c) => [-1, 0, 0, 1].reduce((sum, d) => sum + places.at((k + d) % PLACES)[c] / 4, 0);
  return places.map((_, k) => [mean(k, 0), mean(k, 1)]);
}

// Draw the throw from (fromX, fromY) [R].
function aim({ drawing, send }, fromX, fromY) {
  return {
    move(px, py) {
      const [x, y] = drawing.toWorld(px, py);
      const length = Math.hypot(x - fromX, y - fromY);
      const factor = length ? arrowSpeed(length) / length / AIM_SCALE : 0;
      send({ do: "aim", dx: factor * (x - fromX), dy: factor * (y - fromY) });
    },
    end: (cancelled) => send({ do: cancelled ? "release" : "throw" }),
  };
}

// Turn the disk, which is held at (fromX, fromY) [R].
function turn({ drawing, state, send }, fromX, fromY) {
  const { com_x: centreX, com_y: centreY } = state.row;
  const first = Math.atan2(fromY - centreY, fromX - centreX);
  let angle = 0;
  return {
    move(px, py) {
      const [x, y] = drawing.toWorld(px, py);
      angle = Math.atan2(y - centreY, x - centreX) - first;
      send({ do: "turn", angle, final: 0 });
    },
    end: (cancelled) => angle && send({ do: "turn", angle: cancelled ? 0 : angle, final: 1 }),
  };
}

function pull(sandbox, px, py) {
  const move = (...at) => {
    const [x, y] = sandbox.drawing.toWorld(...at);
    sandbox.target = [x, y];
    sandbox.send({ do: "pull", x, y });
  };
  const end = () => {
    sandbox.target = null;
    sandbox.send({ do: "release" });
  };
  move(px, py);
  return { move, end };
}
