// Draws a disk in one state on a canvas of any size. `drawing.py` makes the scene's message; a state is
//   {t, x: Float32Array(2n) [R], values: Float32Array(n, or one for each spring), limit, row: {com_x, com_y, …},
//    forces: Float32Array(3k) with point, fx, fy [Mc²/R], fullForce, path: [[x, y], …] or nothing}.
// `limit` is the value of full colour (for fringes: the stress difference of one fringe), and `fullForce` is the force
// of an arrow of the length ARROW.
// Without `path` the drawing remembers where the centre of mass was since `setScene`.

import { Field } from "./field.js";
import { ARROW, arrow, drawLegend, footer, line } from "./legend.js";

export const AIM = 0.05; // velocity that an arrow as long as R stands for [c]
const VISIBLE_WALL = 40; // least height of a rigid wall that is always seen, with room for a line of text [px]
const ARROW_DISTANCE = 7; // approximate distance of two arrows [px]
const FINEST = 2; // pixels of the disk in a CSS pixel; more cost time and can hardly be seen
const INDICES = ["triangles", "springs", "outline", "edges", "wall_surface"]; // of the scene's message

export const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
export const decoded = (text, Kind) => new Kind(bytes(text).buffer);

export function centroid(x, count) {
  const sum = [0, 0];
  for (let i = 0; i < 2 * count; i++) sum[i % 2] += x[i];
  return [sum[0] / count, sum[1] / count];
}

export class Drawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.options = {}; // draw, quantity, theme, magnify, outline, path, forces, follow, and arrow: a velocity [c]
    this.camera = { x: 0, y: 1, scale: 100, home: true };
  }

  setScene(message) {
    this.scene = { ...message };
    for (const name of INDICES) this.scene[name] = decoded(message[name], Uint32Array);
    this.scene.rest = decoded(message.rest, Float32Array);
    this.maps = Object.fromEntries(
      Object.entries(message.maps).map(([name, map]) => [name, bytes(map)]),
    );
    this.set(message.options);
    this.spacing = Math.sqrt(3.63 / message.disk_points); // of a triangular lattice that fills the disk [R]
    this.field = this.state = null;
    this.track = [];
    this.camera.home = true;
  }

  set(options) {
    Object.assign(this.options, options);
  }

  // ---- the view: pixels are CSS pixels from the canvas's upper left corner

  fit() {
    const { view, wall } = this.scene,
      [left, right, , top] = view,
      margin = 8,
      isRigid = wall.kind === "rigid";
    const [bottom, below] = isRigid ? [wall.edge, VISIBLE_WALL] : [view[2], margin];
    const width = this.width - 2 * margin,
      height = this.height - footer(this.width) - margin - below;
    const scale = Math.max(Math.min(width / (right - left), height / (top - bottom)), 1);
    const spare = Math.max(height / scale - (top - bottom), 0); // free height, of which a quarter lies below
    const y = (top + bottom + spare / 2 - (below - margin) / scale) / 2;
    this.camera = { x: (left + right) / 2, y, scale, home: true };
  }

  // Show a point in the middle of a picture as wide as `width` [R].
  show(x, y, width) {
    this.camera = { x, y, scale: this.width / width, home: false };
  }

  zoom(factor, px = this.middle[0], py = this.middle[1]) {
    const [x, y] = this.toWorld(px, py),
      { camera } = this;
    camera.scale = Math.min(Math.max(camera.scale * factor, 10), 1e5);
    const [newX, newY] = this.toScreen(x, y);
    this.pan(px - newX, py - newY);
  }

  pan(dx, dy) {
    this.camera.x -= dx / this.camera.scale;
    this.camera.y += dy / this.camera.scale;
    this.camera.home = false;
  }

  get middle() {
    return [this.width / 2, (this.height - footer(this.width)) / 2];
  }

  toWorld(px, py) {
    const { x, y, scale } = this.camera,
      [mx, my] = this.middle;
    return [x + (px - mx) / scale, y - (py - my) / scale];
  }

  toScreen(x, y) {
    const { camera } = this,
      [mx, my] = this.middle;
    return [mx + (x - camera.x) * camera.scale, my - (y - camera.y) * camera.scale];
  }

  point(x, i) {
    return this.toScreen(x[2 * i], x[2 * i + 1]);
  }

  // ---- drawing

  draw(state = this.state) {
    const { canvas, context: ctx, scene, options } = this,
      ratio = devicePixelRatio;
    const { clientWidth: width, clientHeight: height } = canvas;
    const pixels = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== pixels[0] || canvas.height !== pixels[1])
      [canvas.width, canvas.height] = pixels;
    if (!scene || !state || !pixels[0] || !pixels[1]) return;
    const resized = this.width !== width || this.height !== height;
    Object.assign(this, { width, height, state });
    if (this.camera.home && (resized || !this.field)) this.fit();
    const centre = [state.row.com_x, state.row.com_y],
      theme = scene.themes[options.theme],
      { camera } = this;
    if (options.follow) [camera.x, camera.y] = centre;
    const unmoved = options.outline || options.magnify > 1 ? this.unmoved(state.x) : null;
    const x =
      options.magnify > 1
        ? state.x.map((u, i) => unmoved[i] + options.magnify * (u - unmoved[i]))
        : state.x;
    const quantity = scene.quantities.find((one) => one.name === options.quantity),
      { limit } = state;
    const filled = ["field", "both"].includes(options.draw);
    const colours = this.maps[`${options.theme} ${quantity.map}${filled ? "" : " bare"}`];

    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.fillStyle = theme.ground;
    ctx.fillRect(0, 0, width, height);
    ctx.lineJoin = ctx.lineCap = "round";
    if (scene.wall.kind !== "none") this.drawWall(x, theme.wall, ratio);
    const [ox, oy] = this.toScreen(0, 0);
    if (!this.field) this.field = new Field(scene);
    const fineness = Math.min(ratio, FINEST);
    const fieldHeight = Math.round(height * fineness);
    const field = this.field.draw(Math.round(width * fineness), fieldHeight, {
      positions: x,
      values: state.values,
      colours,
      marks: this.marks(fineness),
      fringes: quantity.name === "fringes",
      factor: camera.scale * fineness,
      shift: [ox * fineness, fieldHeight - oy * fineness],
      scale: quantity.signed ? [0.5 / limit, 0.5] : [1 / limit, 0],
    });
    ctx.drawImage(field, 0, 0, width, height);
    if (filled) {
      const sides = new Path2D(); // of the body, of holes, and between materials
      scene.edges.forEach((i, k) => sides[k % 2 ? "lineTo" : "moveTo"](...this.point(x, i)));
      Object.assign(ctx, { strokeStyle: theme.ink, lineWidth: 1.5 });
      ctx.stroke(sides);
    }
    if (scene.spoke >= 0) {
      const spoke = [this.toScreen(...centre), this.point(x, scene.spoke)];
      line(ctx, spoke, theme.ground, 4);
      line(ctx, spoke, theme.ink, 2);
    }
    ctx.fillStyle = theme.wall;
    if (scene.wall.kind !== "none") ctx.fill(this.wallPath(x, scene.wall.edge));
    const ring = () =>
      Array.from([...scene.outline, scene.outline[0]], (i) => this.point(unmoved, i));
    if (options.outline) line(ctx, ring(), theme.faint, 1.3, [5, 4]);
    if (!state.path) this.remember(state.t, centre);
    const path = state.path ?? this.track;
    if (options.path)
      line(
        ctx,
        path.map(([px, py]) => this.toScreen(px, py)),
        theme.accent,
        1.8,
      );
    if (options.forces) this.drawForces(state, x, theme);
    const tip = options.arrow && options.arrow.map((v, axis) => centre[axis] + v / AIM);
    if (tip) this.drawArrow(centre, tip, theme.accent, theme);
    const force = options.forces && scene.wall.kind !== "none" ? state.fullForce : 0;
    drawLegend(ctx, { width, height, theme, quantity, limit, colours, scale: camera.scale, force });
  }

  // Return a promise of the picture as a PNG, with the lines of a title.
  picture(lines) {
    const { context: ctx } = this;
    this.draw();
    Object.assign(ctx, { fillStyle: this.scene.themes[this.options.theme].ink, textAlign: "left" });
    lines.forEach((text, k) => {
      ctx.font = `${k ? "13px" : "bold 17px"} system-ui, sans-serif`;
      ctx.fillText(text, 16, 26 + 20 * k);
    });
    const picture = new Promise((done) => this.canvas.toBlob(done));
    this.draw();
    return picture;
  }

  // Return what the field draws: triangles, with faint springs on them if these are long enough, or springs, or points.
  marks(ratio) {
    const apart = this.spacing * this.camera.scale,
      { draw, quantity } = this.options;
    const between = (low, value, high) => Math.min(Math.max(value, low), high);
    if (draw === "springs")
      return [{ mark: 1, radius: 0.5 * ratio * between(1.5, 0.15 * apart, 4) }];
    if (draw === "points") return [{ mark: 2, radius: ratio * between(1, 0.3 * apart, 6) }];
    const ink =
      draw === "both" && quantity !== "fringes" ? 0.25 * between(0, (apart - 5) / 9, 1) : 0;
    return ink ? [{ mark: 0 }, { mark: 1, radius: 0.75 * ratio, ink }] : [{ mark: 0 }];
  }

  // Return the undeformed disk at the place, height and angle of the disk at `x`. Points of the wall stay.
  unmoved(x) {
    const { rest, disk_points: count } = this.scene,
      out = x.slice();
    const [fromX, fromY] = centroid(rest, count),
      [toX, toY] = centroid(x, count);
    let dot = 0,
      cross = 0; // their ratio is the tangent of the disk's best-fitting rotation
    for (let i = 0; i < 2 * count; i += 2) {
      const ax = rest[i] - fromX,
        ay = rest[i + 1] - fromY,
        bx = x[i] - toX,
        by = x[i + 1] - toY;
      dot += ax * bx + ay * by;
      cross += ax * by - ay * bx;
    }
    const angle = Math.atan2(cross, dot),
      cos = Math.cos(angle),
      sin = Math.sin(angle);
    let lift = -Infinity,
      lowest = Infinity;
    for (let i = 0; i < 2 * count; i += 2) {
      const ax = rest[i] - fromX,
        ay = rest[i + 1] - fromY;
      out[i] = toX + cos * ax - sin * ay;
      out[i + 1] = sin * ax + cos * ay;
      lift = Math.max(lift, -out[i + 1]);
      lowest = Math.min(lowest, x[i + 1]);
    }
    for (let i = 1; i < 2 * count; i += 2) out[i] += lowest + lift;
    return out;
  }

  // Add the present place of the centre of mass to its path.
  remember(t, centre) {
    while (this.track.at(-1)?.[2] >= t) this.track.pop();
    this.track.push([...centre, t]);
  }

  // Return the outline of the wall, up to a height above its points [R].
  wallPath(x, height) {
    const { wall_surface: surface } = this.scene,
      isRigid = !surface.length,
      path = new Path2D();
    const [left, low] = this.toWorld(-this.width, this.height),
      [right] = this.toWorld(2 * this.width, 0);
    const chain = isRigid
      ? [
          [left, 0],
          [right, 0],
        ]
      : Array.from(surface, (i) => [x[2 * i], x[2 * i + 1]]);
    const bottom = isRigid ? Math.min(low, 0) - 1 : -1.3 / this.camera.scale;
    for (const [px, py] of chain) path.lineTo(...this.toScreen(px, py + height));
    for (const [px, py] of chain.reverse()) path.lineTo(...this.toScreen(px, py + bottom));
    return path;
  }

  // Draw the wall, and above its edge a haze that fades as the force does.
  drawWall(x, colour, ratio) {
    const {
      context: ctx,
      scene: { wall },
      camera,
    } = this;
    Object.assign(ctx, {
      fillStyle: colour,
      shadowColor: colour,
      shadowBlur: 4 * wall.decay * camera.scale * ratio,
    });
    ctx.fill(this.wallPath(x, wall.edge));
    ctx.shadowBlur = 0;
  }

  // Draw an arrow for each point on which the wall acts, or for some of the points if they are too close.
  drawForces({ forces, fullForce }, x, theme) {
    const every = Math.ceil(ARROW_DISTANCE / (this.spacing * this.camera.scale)),
      length = ARROW / fullForce;
    for (let k = 0; k < forces.length; k += 3) {
      const [i, fx, fy] = forces.subarray(k, k + 3),
        foot = [x[2 * i], x[2 * i + 1]];
      if (i % every || Math.hypot(fx, fy) < 0.02 * fullForce) continue;
      this.drawArrow(foot, [foot[0] + length * fx, foot[1] + length * fy], theme.arrow, theme, 1.8);
    }
  }

  drawArrow(from, to, colour, theme, thickness = 3) {
    arrow(
      this.context,
      this.toScreen(...from),
      this.toScreen(...to),
      thickness,
      colour,
      theme.ground,
    );
  }
}
