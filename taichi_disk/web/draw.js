// Draws a disk in one state on a canvas, at any size. `taichi_disk/web/drawing.py` makes the scene's message; a state is
//   {t, x: Float32Array(2n) [R], values: Float32Array(n, or one for each spring), limit, row: {com_x, com_y, …},
//    forces: Float32Array(3k) with point, fx, fy [Mc²/R], fullForce, path: [[x, y], …] or nothing}.
// `limit` is the value of full colour (of fringes: the stress difference between two), `fullForce` the force of an arrow
// of ARROW R. Without `path` the drawing remembers where the centre of mass was since `setScene` or `forget`.

import { Field } from "./field.js";
import { ARROW, drawLegend, footer } from "./legend.js";

export const AIM = 0.05; // velocity that an arrow as long as R stands for [c]
const FADES = Array.from({ length: 25 }, (_, k) => (24 - k) / 5); // decay lengths between the layers of the wall's haze
const BELOW = 0.16; // what is seen of a rigid wall below its edge [R]
const APART = 9; // distance of two arrows [px]

export function decoded(text, Kind) {
  return new Kind(Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer);
}

// The rigid motion that best takes the disk's points from `rest` to `x`: both centres, cosine and sine of the angle.
export function rigidMotion(rest, x, count) {
  const [from, to] = [rest, x].map((p) => {
    let px = 0, py = 0;
    for (let i = 0; i < 2 * count; i += 2) (px += p[i]), (py += p[i + 1]);
    return [px / count, py / count];
  });
  let dot = 0, cross = 0;
  for (let i = 0; i < 2 * count; i += 2) {
    const ax = rest[i] - from[0], ay = rest[i + 1] - from[1], bx = x[i] - to[0], by = x[i + 1] - to[1];
    dot += ax * bx + ay * by;
    cross += ax * by - ay * bx;
  }
  const size = Math.hypot(dot, cross) || 1;
  return { from, to, cos: dot / size, sin: cross / size };
}

export class Drawing {
  constructor(canvas) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    this.options = { draw: "both", quantity: "shear", theme: "light", magnify: 1, outline: false, path: false,
      forces: true, arrow: null, limit: null };
    this.camera = { x: 0, y: 1, scale: 100, home: true };
    this.follow = false;
    this.heading = [];
  }

  setScene(message) {
    const kinds = { triangles: Uint32Array, springs: Uint32Array, outline: Uint32Array, edges: Uint32Array, rest: Float32Array };
    this.scene = { ...message, wall: { ...message.wall } };
    for (const [name, Kind] of Object.entries(kinds)) this.scene[name] = decoded(message[name], Kind);
    if (message.wall.surface) this.scene.wall.surface = decoded(message.wall.surface, Uint32Array);
    this.maps = Object.fromEntries(Object.entries(message.maps).map(([name, map]) => [name, decoded(map, Uint8Array)]));
    this.set(message.options);
    const { springs, rest } = this.scene;
    let length = 0;
    for (let k = 0; k < springs.length; k += 2)
      length += Math.hypot(rest[2 * springs[k]] - rest[2 * springs[k + 1]], rest[2 * springs[k] + 1] - rest[2 * springs[k + 1] + 1]);
    this.spacing = (2 * length) / springs.length; // mean length of a spring [R]
    this.field = this.state = null;
    this.camera.home = true;
    this.forget();
  }

  set(options) {
    Object.assign(this.options, options);
  }

  forget() {
    this.track = [];
  }

  // ---- the view: pixels are CSS pixels from the canvas's upper left corner

  fit() {
    const { view, wall } = this.scene, [left, right, , top] = view, margin = 8;
    const bottom = wall.kind === "rigid" ? wall.edge - BELOW : view[2];
    const width = this.width - 2 * margin, height = this.height - footer(this.width) - 2 * margin;
    const scale = Math.max(Math.min(width / (right - left), height / (top - bottom)), 1);
    const spare = Math.max(height / scale - (top - bottom), 0); // a quarter of it is seen below
    this.camera = { x: (left + right) / 2, y: (top + bottom + spare / 2) / 2, scale, home: true };
  }

  zoom(factor, px, py) {
    const [x, y] = this.toWorld(px, py), camera = this.camera;
    camera.scale = Math.min(Math.max(camera.scale * factor, 10), 1e5);
    const [nx, ny] = this.toWorld(px, py);
    this.pan((nx - x) * camera.scale, (y - ny) * camera.scale);
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
    const { x, y, scale } = this.camera, [mx, my] = this.middle;
    return [x + (px - mx) / scale, y - (py - my) / scale];
  }

  toScreen(x, y) {
    const camera = this.camera, [mx, my] = this.middle;
    return [mx + (x - camera.x) * camera.scale, my - (y - camera.y) * camera.scale];
  }

  // ---- drawing

  draw(state = this.state) {
    const { canvas, context: ctx, scene, options } = this, ratio = window.devicePixelRatio || 1;
    const width = canvas.clientWidth || canvas.width, height = canvas.clientHeight || canvas.height;
    const pixels = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== pixels[0] || canvas.height !== pixels[1]) [canvas.width, canvas.height] = pixels;
    if (!scene || !state || !pixels[0] || !pixels[1]) return;
    const resized = this.width !== width || this.height !== height;
    Object.assign(this, { width, height, state });
    if (this.camera.home && resized) this.fit();
    const motion = rigidMotion(scene.rest, state.x, scene.disk_points), { row = {} } = state;
    const centre = [row.com_x ?? motion.to[0], row.com_y ?? motion.to[1]];
    if (this.follow) [this.camera.x, this.camera.y] = centre;
    const theme = scene.themes[options.theme], { camera } = this;
    const unmoved = options.outline || options.magnify > 1 ? this.unmoved(state.x, motion) : null;
    const x = options.magnify > 1 ? magnified(state.x, unmoved, options.magnify) : state.x;
    const quantity = scene.quantities.find((one) => one.name === options.quantity);
    const limit = options.limit ?? state.limit ?? 1, filled = ["field", "both"].includes(options.draw);
    const colours = this.maps[`${options.theme} ${quantity.map}${filled ? "" : " bare"}`];
    const screen = (i) => this.toScreen(x[2 * i], x[2 * i + 1]);

    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.fillStyle = theme.ground;
    ctx.fillRect(0, 0, width, height);
    ctx.lineJoin = ctx.lineCap = "round";
    const wall = this.wallPaths(x);
    ctx.fillStyle = theme.wall;
    wall?.haze.forEach((path, k) => {
      // Each layer covers those outside it: together they leave 1 - exp(-distance) of the ground.
      ctx.globalAlpha = 1 - (1 - Math.exp(-FADES[k + 1] - 0.1)) / (k ? 1 - Math.exp(-FADES[k] - 0.1) : 1);
      ctx.fill(path);
    });
    ctx.globalAlpha = 1;

    const [ox, oy] = this.toScreen(0, 0);
    if (!this.field || this.field.lost) this.field = new Field(scene);
    ctx.drawImage(
      this.field.draw(...pixels, {
        positions: x, values: state.values, colours, marks: this.marks(ratio), fringes: quantity.name === "fringes",
        factor: camera.scale * ratio, shift: [ox * ratio, pixels[1] - oy * ratio],
        scale: quantity.signed ? [0.5 / limit, 0.5] : [1 / limit, 0],
      }), 0, 0, width, height);

    const stroke = (points, colour, thick, dash = []) => {
      ctx.beginPath();
      for (const point of points) ctx.lineTo(...point);
      ctx.strokeStyle = colour;
      ctx.lineWidth = thick;
      ctx.setLineDash(dash);
      ctx.stroke();
      ctx.setLineDash([]);
    };
    if (filled) {
      ctx.beginPath();
      for (let k = 0; k < scene.edges.length; k += 2) {
        const [i, j] = scene.edges.subarray(k, k + 2);
        if (i < scene.disk_points && scene.wall.surface && this.inWall(x, i) && this.inWall(x, j)) continue;
        ctx.moveTo(...screen(i));
        ctx.lineTo(...screen(j));
      }
      ctx.strokeStyle = theme.ink;
      ctx.lineWidth = 1.5;
      ctx.stroke();
    }
    if (scene.spoke >= 0) {
      const ends = [this.toScreen(...centre), screen(scene.spoke)];
      stroke(ends, theme.ground, 4);
      stroke(ends, theme.ink, 2);
    }
    ctx.fillStyle = theme.wall;
    if (wall) ctx.fill(wall.solid);
    if (options.outline) {
      const ring = Array.from(scene.outline, (i) => this.toScreen(unmoved[2 * i], unmoved[2 * i + 1]));
      stroke([...ring, ring[0]], theme.faint, 1.3, [5, 4]);
    }
    if (!state.path) this.remember(state.t, centre);
    if (options.path) stroke((state.path ?? this.track).map(([x, y]) => this.toScreen(x, y)), theme.accent, 1.8);
    if (options.forces && state.forces) this.drawForces(state, x, theme);
    if (options.arrow) {
      const [vx, vy] = options.arrow, tip = [centre[0] + vx / AIM, centre[1] + vy / AIM];
      this.drawArrow(this.toScreen(...centre), this.toScreen(...tip), 3, 9, theme.accent, theme.ground);
    }
    const force = options.forces && scene.wall.kind !== "none" ? this.fullForce(state) : 0;
    drawLegend(ctx, { width, height, theme, quantity, limit, colours, scale: camera.scale, force });
    ctx.fillStyle = theme.ink;
    ctx.textAlign = "left";
    this.heading.forEach((line, k) => {
      ctx.font = `${k ? "" : "bold "}${k ? 13 : 17}px system-ui, sans-serif`;
      ctx.fillText(line, 16, 26 + 20 * k);
    });
  }

  // A promise of the canvas as a PNG, with the lines of a title.
  picture(lines = this.scene.title) {
    this.heading = lines;
    this.draw();
    const picture = new Promise((done) => this.canvas.toBlob(done));
    this.heading = [];
    this.draw();
    return picture;
  }

  // What the lattice is drawn as: triangles, springs faintly on them where they are far enough apart, springs, points.
  marks(ratio) {
    const apart = this.spacing * this.camera.scale, { draw, quantity } = this.options;
    if (draw === "springs") return [{ mark: 1, radius: 0.5 * ratio * Math.min(Math.max(0.15 * apart, 1.5), 4) }];
    if (draw === "points") return [{ mark: 2, radius: ratio * Math.min(Math.max(0.3 * apart, 1), 6) }];
    const seen = draw === "both" && quantity !== "fringes" ? 0.25 * Math.min(Math.max((apart - 5) / 9, 0), 1) : 0;
    const springs = { mark: 1, radius: 0.75 * ratio, ink: [0, 0, 0, seen] };
    return seen ? [{ mark: 0 }, springs] : [{ mark: 0 }];
  }

  fullForce(state) {
    return state.fullForce ?? this.scene.full_force;
  }

  // The disk as it began, turned as much and standing as low as it does. A wall stays as it is.
  unmoved(x, { from, to, cos, sin }) {
    const { rest, disk_points } = this.scene, out = x.slice();
    let lowest = Infinity, low = Infinity;
    for (let i = 0; i < 2 * disk_points; i += 2) {
      const dx = rest[i] - from[0], dy = rest[i + 1] - from[1];
      out[i] = to[0] + cos * dx - sin * dy;
      out[i + 1] = sin * dx + cos * dy;
      low = Math.min(low, out[i + 1]);
      lowest = Math.min(lowest, x[i + 1]);
    }
    for (let i = 1; i < 2 * disk_points; i += 2) out[i] += lowest - low;
    return out;
  }

  // Where the centre of mass has been up to now.
  remember(t, centre) {
    while (this.track.at(-1)?.[2] >= t) this.track.pop();
    this.track.push([...centre, t]);
  }

  // The wall's haze, outermost first, and its body up to the edge where its force on a point is the largest.
  wallPaths(x) {
    const { wall } = this.scene, { scale } = this.camera;
    if (wall.kind === "none") return null;
    const decay = Math.max(wall.decay, 0.4 / scale);
    const [left, low] = this.toWorld(0, this.height), [right] = this.toWorld(this.width, 0);
    let chain = [[left, 0], [right, 0]];
    if (wall.surface) chain = Array.from(wall.surface, (i) => [x[2 * i], x[2 * i + 1]]);
    const raised = (height) => chain.map(([px, py]) => this.toScreen(px, py + height));
    const below = raised(wall.surface ? -1.3 / scale : Math.min(low, 0) - 1).reverse();
    const between = (height) => {
      const path = new Path2D();
      for (const point of [...raised(height), ...below]) path.lineTo(...point);
      return path;
    };
    return { haze: FADES.slice(0, -1).map((fade) => between(wall.edge + decay * fade)), solid: between(wall.edge) };
  }

  inWall(x, i) {
    return x[2 * i + 1] < this.wallHeight(x[2 * i], x) - this.scene.wall.edge;
  }

  wallHeight(px, x) {
    const { surface, edge } = this.scene.wall;
    if (!surface) return edge;
    const k = surface.findIndex((i, n) => x[2 * i] <= px && px < x[2 * surface[n + 1]]);
    return k < 0 ? -Infinity : edge + Math.max(x[2 * surface[k] + 1], x[2 * surface[k + 1] + 1]);
  }

  // One arrow for all points within APART of each other, with the mean of their forces; it begins above the wall's edge.
  drawForces(state, x, theme) {
    const { forces } = state, full = this.fullForce(state), groups = new Map();
    if (!full) return;
    for (let k = 0; k < forces.length; k += 3) {
      const i = forces[k], [column] = this.toScreen(x[2 * i], 0), key = Math.floor(column / APART);
      if (Math.hypot(forces[k + 1], forces[k + 2]) < 0.02 * full) continue;
      const sum = groups.get(key) ?? groups.set(key, [0, 0, 0, 0, 0]).get(key);
      [1, x[2 * i], x[2 * i + 1], forces[k + 1], forces[k + 2]].forEach((part, n) => (sum[n] += part));
    }
    for (const [count, ...sums] of groups.values()) {
      const [px, py, fx, fy] = sums.map((sum) => sum / count);
      const foot = [px, Math.max(py, this.wallHeight(px, x))], length = ARROW / full;
      this.drawArrow(this.toScreen(...foot), this.toScreen(foot[0] + length * fx, foot[1] + length * fy), 1.8, 4.5, theme.arrow, theme.ground);
    }
  }

  drawArrow([x0, y0], [x1, y1], thick, head, colour, rim) {
    const ctx = this.context, length = Math.hypot(x1 - x0, y1 - y0);
    if (!(length > 0)) return;
    const wing = Math.min(head, 0.3 * length), ux = (x1 - x0) / length, uy = (y1 - y0) / length;
    const at = (along, across) => [x0 + along * ux - across * uy, y0 + along * uy + across * ux];
    const neck = length - 2 * wing, half = thick / 2;
    ctx.beginPath();
    for (const corner of [[0, half], [neck, half], [neck, wing], [length, 0], [neck, -wing], [neck, -half], [0, -half]])
      ctx.lineTo(...at(...corner));
    ctx.closePath();
    ctx.lineWidth = 2;
    ctx.strokeStyle = rim;
    ctx.stroke();
    ctx.fillStyle = colour;
    ctx.fill();
  }
}

function magnified(x, unmoved, factor) {
  return x.map((value, i) => unmoved[i] + factor * (value - unmoved[i]));
}
