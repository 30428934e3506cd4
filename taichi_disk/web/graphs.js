// Curves over time that can be dragged back, and the diagram of results: on canvases, with names in HTML beside them.

import { FONT, label, line, roundAbove, roundBelow } from "./legend.js";

const SIDE = 54; // room for numbers on either side of a canvas [px]

export function legend(caption, names) {
  caption.replaceChildren(...names.map(([textContent, colour]) => {
    const name = Object.assign(document.createElement("span"), { textContent });
    if (colour) name.style.setProperty("--curve", colour);
    return name;
  }));
}

// A canvas with a frame. Scales are {low, high}; ticks are [part of the width, text].
class Axes {
  constructor(canvas, theme, ticks, left, right) {
    const { clientWidth: width, clientHeight: height } = canvas, ctx = (this.ctx = canvas.getContext("2d"));
    Object.assign(canvas, { width: width * devicePixelRatio, height: height * devicePixelRatio });
    ctx.scale(devicePixelRatio, devicePixelRatio);
    this.size = [width - 2 * SIDE, height - 30];
    const write = (text, x, y, textAlign) => {
      Object.assign(ctx, { font: FONT, fillStyle: theme.faint, textAlign });
      ctx.fillText(text, x, y);
    };
    for (const part of [0, 0.5, 1]) {
      const y = this.place(0, part, { low: 0, high: 1 })[1];
      line(ctx, [[SIDE, y], [width - SIDE, y]], theme.rule, 1);
      write(label(left.low + part * (left.high - left.low)), SIDE - 6, y + 4, "right");
      if (right) write(label(right.low + part * (right.high - right.low)), width - SIDE + 6, y + 4, "left");
    }
    for (const [part, text] of ticks) {
      const x = this.place(part, 0, left)[0];
      line(ctx, [[x, height - 22], [x, height - 18]], theme.faint, 1);
      write(text, part === 1 ? x + 10 : x, height - 6, part === 1 ? "right" : "center");
    }
  }

  place(part, value, { low, high }) {
    return [SIDE + part * this.size[0], 8 + (1 - (value - low) / (high - low)) * this.size[1]];
  }
}

export class Graphs {
  // `scrub` is called with a time since the hit began [R/c], wherever a pointer drags.
  constructor(canvases, scrub) {
    Object.assign(this, { canvases, data: null, full: null });
    for (const canvas of canvases) {
      canvas.onpointerdown = canvas.onpointermove = (event) => {
        if (!(event.buttons & 1) || !this.data) return;
        canvas.setPointerCapture(event.pointerId);
        const part = (event.offsetX - SIDE) / (canvas.clientWidth - 2 * SIDE);
        scrub(Math.min(Math.max(part, 0), 1) * this.full.t);
      };
    }
  }

  replace(data, curves) {
    const goesOn = this.data?.began === data.began && data.t.length > 2;
    Object.assign(this, { data, curves });
    if (!goesOn) this.full = { t: 1, energy: 1e-30, force: 1e-30, motion: 1e-30 };
    const largest = (curve) => curve.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    this.grow(data.t.at(-1), data.values.map(largest));
  }

  add({ t, graph }) {
    const { data } = this;
    if (!data || t <= data.t.at(-1)) return;
    data.t.push(t);
    data.values.forEach((curve, k) => curve.push(graph[k]));
    this.grow(t, graph);
  }

  grow(t, values) {
    const grow = (name, value) => value > this.full[name] && (this.full[name] = roundAbove(1.05 * value));
    grow("t", 1.1 * t);
    this.curves.forEach(([name], k) => grow(name, Math.abs(values[k])));
  }

  draw(t, theme) {
    const { data, full, curves } = this;
    if (!data || !this.canvases[0].clientWidth) return;
    const step = roundBelow(full.t / 3), count = Math.ceil((0.8 * full.t) / step);
    const low = data.motion[1] === "c" ? -1 : 0; // a velocity has both signs
    const ticks = Array.from({ length: count }, (_, k) => [(k * step) / full.t, label(k * step)]);
    const scales = { energy: { low: 0, high: full.energy } };
    for (const name of ["force", "motion"]) scales[name] = { low: low * full[name], high: full[name] };
    this.canvases.forEach((canvas, second) => {
      const shown = second ? ["force", "motion"] : ["energy"], sides = shown.map((name) => scales[name]);
      const axes = new Axes(canvas, theme, [...ticks, [1, `t = ${label(full.t)} R/c`]], ...sides);
      curves.forEach(([name, , colour], k) => {
        const points = () => data.t.map((time, n) => axes.place(time / full.t, data.values[k][n], scales[name]));
        if (shown.includes(name)) line(axes.ctx, points(), colour, 1.8);
      });
      const now = [0, 1].map((value) => axes.place(Math.min(t / full.t, 1), value, { low: 0, high: 1 }));
      line(axes.ctx, now, theme.accent, 2);
    });
  }
}

// Results over the speed or load, on a logarithmic axis; those that the user disturbed are hollow.
export function drawResults(canvas, results, theme) {
  if (!canvas.clientWidth || !results.length) return;
  const loads = results.map((one) => one.load), values = results.map((one) => one.value);
  const first = Math.min(...loads, 5e-3) / 1.2, last = Math.max(...loads, 5e-2) * 1.2;
  const part = (load) => Math.log(load / first) / Math.log(last / first), isRatio = results[0].result === "e";
  const low = isRatio ? Math.max(Math.floor(10 * Math.min(...values) - 0.2) / 10, 0) : 0;
  const scale = { low, high: isRatio ? Math.max(1, ...values) : roundAbove(Math.max(...values)) };
  const decades = [1e-4, 1e-3, 1e-2, 0.1].filter((load) => first < load && load < last);
  const axes = new Axes(canvas, theme, decades.map((load) => [part(load), label(load)]), scale), { ctx } = axes;
  Object.assign(ctx, { strokeStyle: theme.accent, fillStyle: theme.accent, lineWidth: 1.8 });
  for (const { load, value, disturbance } of results) {
    const circle = new Path2D();
    circle.arc(...axes.place(part(load), value, scale), 4, 0, 7);
    disturbance ? ctx.stroke(circle) : ctx.fill(circle);
  }
}
