// Draws a disk in one state on a canvas of any size. `drawing.py` makes the scene's message; a
// state is {t, x: Float32Array(2n) [R], values: Float32Array(n, or one for each spring), limit,
// row: {com_x, com_y, …}, forces: Float32Array(3k) with point, fx, fy [Mc²/R], fullForce,
// path: [[x, y], …] or nothing}.
// `limit` is the value of full colour (for fringes: the stress difference of one fringe), and
// `fullForce` is the force of an arrow of the length ARROW.
// `written` is the limit in the legend, if it is another.
// Without `path` the drawing remembers where the centre of mass was since `setScene`.

import { Field } from "./field.js";
import { ARROW, arrow, drawLegend, footer, label, line } from "./legend.js";

const LONGEST_ARROW = 0.9; // length of the velocity's arrow at most [R], ...
const FASTEST = 0.1; // ... reached at this speed [c]; shorter ones go by its square root
// least height of a rigid wall that is always seen, with room for a line of text [px], ...
const VISIBLE_WALL = 40;
const WALL_PART = 0.12; // ... but at most this part of the picture
const ARROW_DISTANCE = 7; // approximate distance of two arrows [px]
const FINEST = 2; // pixels of the disk in a CSS pixel; more cost time and can hardly be seen
// arrays of the scene's message
const INDICES = ["triangles", "springs", "outline", "edges", "wall_surface"];

export const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
export const decoded = (text, Kind) => new Kind(bytes(text).buffer);

export function centroid(x, count) {
  const sum = [0, 0];
  for (let i = 0; i < 2 * count; i++) sum[i % 2] += x[i];
  return [sum[0] / count, sum[1] / count];
}

// Return the angle [rad] by which the first `count` points at `from` turn to fit those at `to`
// best.
function rotation(from, to, count) {
  const [fromX, fromY] = centroid(from, count);
  let dot = 0;
  let cross = 0; // cross / dot is the tangent of the angle
  for (let i = 0; i < 2 * count; i += 2) {
    const ax = from[i] - fromX;
    const ay = from[i + 1] - fromY;
    dot += ax * to[i] + ay * to[i + 1];
    cross += ax * to[i + 1] - ay * to[i];
  }
  return Math.atan2(cross, dot);
}

// Return the length of the arrow of a velocity [R], and the speed for which an arrow stands [c].
export const arrowLength = (speed) => LONGEST_ARROW * Math.min(Math.sqrt(speed / FASTEST), 1);
export const arrowSpeed = (length) => FASTEST * Math.min(length / LONGEST_ARROW, 1) ** 2;

export class Drawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    // draw, quantity, theme, magnify, outline, path, forces, follow; arrow: a velocity [c]; canAim:
    // whether its tip can be dragged; isAimed: whether the speed is written beside it; letters: their
    // size
    this.options = { letters: 1 };
    this.camera = { x: 0, y: 1, scale: 100, home: true };
  }

  setScene(message) {
    this.scene = { ...message };
    for (const name of INDICES) this.scene[name] = decoded(message[name], Uint32Array);
    this.scene.rest = decoded(message.rest, Float32Array);
    const maps = Object.entries(message.maps);
    this.maps = Object.fromEntries(maps.map(([name, map]) => [name, bytes(map)]));
    this.set(message.options);
    // of a triangular lattice that fills the disk [R]
    this.spacing = Math.sqrt(3.63 / message.disk_points);
    this.field = null;
    this.state = null;
    this.track = [];
    this.camera.home = true;
  }

  set(options) {
    Object.assign(this.options, options);
  }

  // ---- the view: pixels are CSS pixels from the canvas's upper left corner

  fit() {
    const { view, wall } = this.scene;
    const [left, right, lowest, top] = view;
    const margin = 8;
    let bottom = lowest;
    let below = margin;
    if (wall.kind === "rigid") {
      bottom = wall.edge;
      below = Math.min(VISIBLE_WALL * this.options.letters, WALL_PART * this.height);
    }
    const width = this.width - 2 * margin;
    const height = this.height - this.footer - margin - below;
    const scale = Math.max(Math.min(width / (right - left), height / (top - bottom)), 1);
    // free height, of which a quarter lies below
    const spare = Math.max(height / scale - (top - bottom), 0);
    const y = (top + bottom + spare / 2 - (below - margin) / scale) / 2;
    this.camera = { x: (left + right) / 2, y, scale, home: true };
  }

  // Show a point in the middle of a picture as wide as `width` [R].
  show(x, y, width) {
    this.camera = { x, y, scale: this.width / width, home: false };
  }

  zoom(factor, px = this.middle[0], py = this.middle[1]) {
    const { camera } = this;
    const [x, y] = this.toWorld(px, py);
    camera.scale = Math.min(Math.max(camera.scale * factor, 10), 1e5);
    const [newX, newY] = this.toScreen(x, y);
    this.pan(px - newX, py - newY);
  }

  pan(dx, dy) {
    this.camera.x -= dx / this.camera.scale;
    this.camera.y += dy / this.camera.scale;
    this.camera.home = false;
  }

  // Height of the legend [px].
  get footer() {
    const { letters } = this.options;
    return letters * footer(this.width / letters, this.height / letters);
  }

  get middle() {
    return [this.width / 2, (this.height - this.footer) / 2];
  }

  toWorld(px, py) {
    const { x, y, scale } = this.camera;
    const [mx, my] = this.middle;
    return [x + (px - mx) / scale, y - (py - my) / scale];
  }

  toScreen(x, y) {
    const { camera } = this;
    const [mx, my] = this.middle;
    return [mx + (x - camera.x) * camera.scale, my - (y - camera.y) * camera.scale];
  }

  point(x, i) {
    return this.toScreen(x[2 * i], x[2 * i + 1]);
  }

  // ---- drawing

  draw(state = this.state) {
    if (!this.resize() || !this.scene || !state) return;
    const { context: ctx, scene, options, camera } = this;
    this.state = state;
    if (camera.home && (this.isResized || !this.field)) this.fit();
    const centre = [state.row.com_x, state.row.com_y];
    if (options.follow) [this.camera.x, this.camera.y] = centre;
    const { theme } = this;
    const isMoved = options.magnify * (options.ringing ?? 1) > 1;
    const x = isMoved ? this.placed(state.x) : state.x;

    ctx.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    ctx.fillStyle = theme.ground;
    ctx.fillRect(0, 0, this.width, this.height);
    ctx.lineJoin = ctx.lineCap = "round";
    this.drawHaze(x, theme.wall);
    this.drawField(x, state);
    if (this.isFilled) this.drawSides(x, theme);
    if (scene.spoke >= 0) this.drawSpoke(centre, this.point(x, scene.spoke), theme);
    ctx.fillStyle = theme.wall;
    ctx.fill(this.wallPath(x, scene.wall.edge));
    if (options.outline) {
      const unmoved = this.unmoved(state.x);
      const ring = Array.from([...scene.outline, scene.outline[0]], (i) => this.point(unmoved, i));
      line(ctx, ring, theme.faint, 1.3, [5, 4]);
    }
    if (!state.path) this.remember(state.t, centre);
    if (options.path) {
      const path = (state.path ?? this.track).map(([px, py]) => this.toScreen(px, py));
      line(ctx, path, theme.velocity, 1.8);
    }
    if (options.forces) this.drawForces(state, x, theme);
    if (options.arrow) this.drawVelocity(centre, options.arrow, theme);
    this.drawLegend(state, theme);
  }

  // Give the canvas as many pixels as it covers; return whether it covers any.
  resize() {
    const { canvas } = this;
    const { clientWidth: width, clientHeight: height } = canvas;
    this.isResized = this.width !== width || this.height !== height;
    this.ratio = devicePixelRatio;
    this.width = width;
    this.height = height;
    const pixelWidth = Math.round(width * this.ratio);
    const pixelHeight = Math.round(height * this.ratio);
    if (canvas.width !== pixelWidth) canvas.width = pixelWidth;
    if (canvas.height !== pixelHeight) canvas.height = pixelHeight;
    return pixelWidth > 0 && pixelHeight > 0;
  }

  get theme() {
    return this.scene.themes[this.options.theme];
  }

  get isFilled() {
    return ["field", "both"].includes(this.options.draw);
  }

  get quantity() {
    return this.scene.quantities.find(({ name }) => name === this.options.quantity);
  }

  get colours() {
    const bare = this.isFilled ? "" : " bare";
    return this.maps[`${this.options.theme} ${this.quantity.map}${bare}`];
  }

  drawField(x, { values, limit }) {
    const { width, height, quantity } = this;
    this.field ??= new Field(this.scene);
    const fineness = Math.min(this.ratio, FINEST);
    const rows = Math.round(height * fineness);
    const [originX, originY] = this.toScreen(0, 0);
    const field = this.field.draw(Math.round(width * fineness), rows, {
      positions: x,
      values,
      colours: this.colours,
      marks: this.marks(fineness),
      fringes: quantity.name === "fringes",
      factor: this.camera.scale * fineness,
      shift: [originX * fineness, rows - originY * fineness],
      scale: quantity.signed ? [0.5 / limit, 0.5] : [1 / limit, 0],
    });
    this.context.drawImage(field, 0, 0, width, height);
  }

  // Draw the sides of the body, of holes, and between materials.
  drawSides(x, theme) {
    const sides = new Path2D();
    this.scene.edges.forEach((i, k) => sides[k % 2 ? "lineTo" : "moveTo"](...this.point(x, i)));
    const lineWidth = 1.5 * this.options.letters;
    Object.assign(this.context, { strokeStyle: theme.ink, lineWidth });
    this.context.stroke(sides);
  }

  drawSpoke(centre, rim, theme) {
    const spoke = [this.toScreen(...centre), rim];
    line(this.context, spoke, theme.ground, 4);
    line(this.context, spoke, theme.ink, 2);
  }

  // Draw the arrow of a velocity and, while it is aimed, its speed beside the tip.
  drawVelocity(centre, [vx, vy], theme) {
    const { context: ctx } = this;
    const speed = Math.hypot(vx, vy);
    if (!speed) return;
    const length = arrowLength(speed) / speed;
    const tip = [centre[0] + length * vx, centre[1] + length * vy];
    this.drawArrow(centre, tip, this.options.canAim ? theme.accent : theme.velocity, theme);
    if (!this.options.isAimed) return;
    const { letters } = this.options;
    const [px, py] = this.toScreen(...tip);
    ctx.font = `bold ${14 * letters}px system-ui, sans-serif`;
    Object.assign(ctx, { textAlign: "left", lineWidth: 4, strokeStyle: theme.ground });
    ctx.fillStyle = theme.ink;
    const text = `${label(Number(speed.toPrecision(3)))} c`;
    ctx.strokeText(text, px + 12, py);
    ctx.fillText(text, px + 12, py);
  }

  drawLegend({ limit, written = limit, fullForce }, theme) {
    const { context: ctx, options, quantity, colours } = this;
    const { letters } = options;
    ctx.save();
    ctx.scale(letters, letters);
    drawLegend(ctx, {
      width: this.width / letters,
      height: this.height / letters,
      theme,
      quantity,
      limit: written,
      colours,
      scale: this.camera.scale / letters,
      force: options.forces ? fullForce : 0,
    });
    ctx.restore();
  }

  // Return a promise of the picture as a PNG, with the lines of a title.
  picture(lines) {
    const { context: ctx } = this;
    this.draw();
    Object.assign(ctx, { fillStyle: this.theme.ink, textAlign: "left" });
    lines.forEach((text, k) => {
      ctx.font = `${k ? "13px" : "bold 17px"} system-ui, sans-serif`;
      ctx.fillText(text, 16, 26 + 20 * k);
    });
    const picture = new Promise((done) => this.canvas.toBlob(done));
    this.draw();
    return picture;
  }

  // Return what the field draws: triangles, with faint springs on them if these are long enough, or
  // springs, or points.
  marks(ratio) {
    const apart = this.spacing * this.camera.scale;
    const { draw, quantity } = this.options;
    const between = (low, value, high) => Math.min(Math.max(value, low), high);
    if (draw === "springs")
      return [{ mark: "springs", radius: 0.5 * ratio * between(1.5, 0.15 * apart, 4) }];
    if (draw === "points") return [{ mark: "points", radius: ratio * between(1, 0.3 * apart, 6) }];
    const ink =
      draw === "both" && quantity !== "fringes" ? 0.25 * between(0, (apart - 5) / 9, 1) : 0;
    const radius = 0.75 * ratio * Math.sqrt(this.options.letters);
    const field = { mark: "triangles" };
    return ink ? [field, { mark: "springs", radius, ink }] : [field];
  }

  // Return the undeformed disk at the place, height and angle of the disk at `x`. Points of the
  // wall stay.
  unmoved(x) {
    const { rest, disk_points: count } = this.scene;
    const out = x.slice();
    const [fromX, fromY] = centroid(rest, count);
    const [toX] = centroid(x, count);
    const angle = rotation(rest, x, count);
    const cos = Math.cos(angle);
    const sin = Math.sin(angle);
    let lift = -Infinity;
    let lowest = Infinity;
    for (let i = 0; i < 2 * count; i += 2) {
      const ax = rest[i] - fromX;
      const ay = rest[i + 1] - fromY;
      out[i] = toX + cos * ax - sin * ay;
      out[i + 1] = sin * ax + cos * ay;
      lift = Math.max(lift, -out[i + 1]);
      lowest = Math.min(lowest, x[i + 1]);
    }
    for (let i = 1; i < 2 * count; i += 2) out[i] += lowest + lift;
    return out;
  }

  // Return where points are drawn if displacements are magnified, and those of a ringing around the
  // disk's centre: none below the wall's edge or, if that is lower, below the lowest one in truth.
  placed(x) {
    const { disk_points: count, wall } = this.scene;
    const { magnify, ringing = 1 } = this.options;
    const unmoved = this.unmoved(x);
    const moved = x.map((value, i) => magnify * (value - unmoved[i]));
    const shift = centroid(moved, count);
    for (let i = 0; i < 2 * count; i++)
      moved[i] = shift[i % 2] + ringing * (moved[i] - shift[i % 2]);
    const out = moved.map((value, i) => unmoved[i] + value);
    let floor = wall.edge ?? -Infinity;
    for (let i = 1; i < 2 * count; i += 2) floor = Math.min(floor, x[i]);
    for (let i = 1; i < 2 * count; i += 2) out[i] = Math.max(out[i], floor);
    return out;
  }

  // Add the present place of the centre of mass to its path.
  remember(t, centre) {
    while (this.track.at(-1)?.[2] >= t) this.track.pop();
    this.track.push([...centre, t]);
  }

  // Return the outline of the wall, up to a height above its points [R].
  wallPath(x, height) {
    const { wall_surface: surface } = this.scene;
    const path = new Path2D();
    let chain = Array.from(surface, (i) => [x[2 * i], x[2 * i + 1]]);
    let bottom = -1.3 / this.camera.scale;
    if (!surface.length) {
      const [left, low] = this.toWorld(-this.width, this.height);
      const [right] = this.toWorld(2 * this.width, 0);
      chain = [left, right].map((end) => [end, 0]);
      bottom = Math.min(low, 0) - 1;
    }
    for (const [px, py] of chain) path.lineTo(...this.toScreen(px, py + height));
    for (const [px, py] of chain.reverse()) path.lineTo(...this.toScreen(px, py + bottom));
    return path;
  }

  // Draw the wall with a haze above its edge, which fades as the force does.
  drawHaze(x, colour) {
    const { context: ctx, scene } = this;
    const blur = 4 * scene.wall.decay * this.camera.scale * this.ratio;
    Object.assign(ctx, { fillStyle: colour, shadowColor: colour, shadowBlur: blur });
    ctx.fill(this.wallPath(x, scene.wall.edge));
    ctx.shadowBlur = 0;
  }

  // Draw an arrow for each point on which the wall acts, or for some of the points if they are too
  // close.
  drawForces({ forces, fullForce }, x, theme) {
    const every = Math.ceil(ARROW_DISTANCE / (this.spacing * this.camera.scale));
    const length = ARROW / fullForce;
    for (let k = 0; k < forces.length; k += 3) {
      const i = forces[k];
      const fx = forces[k + 1];
      const fy = forces[k + 2];
      if (i % every || Math.hypot(fx, fy) < 0.02 * fullForce) continue;
      const foot = [x[2 * i], x[2 * i + 1]];
      const tip = [foot[0] + length * fx, foot[1] + length * fy];
      this.drawArrow(foot, tip, theme.arrow, theme, 1.8);
    }
  }

  // Draw the outline of a body to be, and a mark where it has a fault.
  drawStroke(stroke, place, theme) {
    const { context: ctx } = this;
    line(ctx, [...stroke, ...stroke.slice(0, 1)].map((at) => this.toScreen(...at)), theme.accent, 2);
    if (!place) return;
    ctx.beginPath();
    ctx.arc(...this.toScreen(...place), 12, 0, 2 * Math.PI);
    ctx.stroke();
  }

  drawArrow(from, to, colour, theme, thickness = 3) {
    const ends = [this.toScreen(...from), this.toScreen(...to)];
    arrow(this.context, ...ends, thickness * this.options.letters, colour, theme.ground);
  }
}
