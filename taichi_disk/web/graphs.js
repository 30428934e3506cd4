// Curves over time that can be dragged back, and the diagram of results: on a canvas, with names in HTML beside it.

import { label, roundBelow } from "./legend.js";

const AXIS_FONT = "12px system-ui, sans-serif";
const above = (value) => [1, 1.5, 2, 3, 5, 7, 10].find((step) => step >= value / 10 ** Math.floor(Math.log10(value)) - 1e-9)
  * 10 ** Math.floor(Math.log10(value));

export function legend(caption, names) {
  caption.replaceChildren(...names.map(([text, colour]) => {
    const name = document.createElement("span");
    name.textContent = text;
    if (colour) name.style.setProperty("--curve", colour);
    return name;
  }));
}

// Axes of a canvas, and what lies on them. `left` and `right` are the scales at both sides: {low, high, colour}.
class Axes {
  constructor(canvas, theme) {
    const ratio = devicePixelRatio || 1, [width, height] = [canvas.clientWidth, canvas.clientHeight];
    Object.assign(canvas, { width: width * ratio, height: height * ratio });
    this.ctx = canvas.getContext("2d");
    this.ctx.scale(ratio, ratio);
    this.ctx.font = AXIS_FONT;
    Object.assign(this, { theme, box: [54, 8, width - 54, height - 22] });
  }

  frame(left, right, ticks, unit) {
    const { ctx, box: [x0, y0, x1, y1], theme } = this;
    for (const part of [0, 0.5, 1]) {
      const y = y1 - part * (y1 - y0);
      ctx.fillStyle = theme.rule;
      ctx.fillRect(x0, y, x1 - x0, 1);
      for (const [side, x, align] of [[left, x0 - 6, "right"], [right, x1 + 6, "left"]]) {
        if (!side) continue;
        ctx.fillStyle = side.colour ?? theme.faint;
        ctx.textAlign = align;
        ctx.fillText(label(side.low + part * (side.high - side.low)), x, y + 4);
      }
    }
    ctx.fillStyle = theme.faint;
    for (const [part, text, last] of ticks) {
      const x = x0 + part * (x1 - x0);
      ctx.fillRect(x, y1, 1, 4);
      ctx.textAlign = last ? "right" : "center";
      ctx.fillText(last ? `${text} ${unit}` : text, last ? x1 + 10 : x, y1 + 16);
    }
  }

  curve(xs, ys, high, { low, high: top }, colour) {
    const { ctx, box: [x0, y0, x1, y1] } = this;
    ctx.beginPath();
    ctx.strokeStyle = colour;
    ctx.lineWidth = 1.8;
    xs.forEach((x, k) => ctx.lineTo(x0 + (x / high) * (x1 - x0), y1 - ((ys[k] - low) / (top - low)) * (y1 - y0)));
    ctx.stroke();
  }
}

export class Graphs {
  // `scrub` is called with a time since the hit began, wherever a pointer drags.
  constructor(canvases, scrub) {
    Object.assign(this, { canvases, data: null, full: {} });
    for (const canvas of canvases) {
      const drag = (event) => {
        const [left, right] = [54, canvas.clientWidth - 54], part = (event.offsetX - left) / (right - left);
        if (event.buttons & 1 && this.data) scrub(Math.min(Math.max(part, 0), 1) * this.full.t);
      };
      canvas.onpointerdown = (event) => {
        canvas.setPointerCapture(event.pointerId);
        drag(event);
      };
      canvas.onpointermove = drag;
    }
  }

  replace(data) {
    const same = this.data && data.began === this.data.began && data.t.length > 2;
    this.data = data;
    if (!same) this.full = { t: 1, energy: 1e-30, force: 1e-30, motion: 1e-30 };
    this.grow(data.t.at(-1), data.values.map((curve) => curve.reduce((most, one) => Math.max(most, Math.abs(one)), 0)));
  }

  add(state) {
    const { data } = this;
    if (!data || state.t <= data.t.at(-1)) return;
    data.t.push(state.t);
    data.values.forEach((curve, k) => curve.push(state.graph[k]));
    this.grow(state.t, state.graph.map(Math.abs));
  }

  grow(t, values) {
    const most = { t, energy: Math.max(...values.slice(0, 5)), force: values[5], motion: values[6] };
    for (const [name, value] of Object.entries(most)) {
      if (value > this.full[name]) this.full[name] = above(name === "t" ? 1.15 * value : 1.05 * value);
    }
  }

  draw(t, curves, theme) {
    const { data, full } = this;
    if (!data || !this.canvases[0].clientWidth) return;
    const step = roundBelow(full.t / 3), ticks = [];
    for (let k = 0; k * step < 0.8 * full.t; k++) ticks.push([(k * step) / full.t, label(k * step)]);
    ticks.push([1, `t = ${label(full.t)}`, true]);
    const energy = { low: 0, high: full.energy }, signed = data.motion[1] === "c";
    const force = { low: signed ? -full.force : 0, high: full.force, colour: theme.ink };
    const motion = { low: signed ? -full.motion : 0, high: full.motion, colour: theme.ink };
    this.canvases.forEach((canvas, graph) => {
      const axes = new Axes(canvas, theme);
      axes.frame(graph ? force : energy, graph ? motion : null, ticks, "R/c");
      curves.forEach(([name, , colour], k) => {
        if ((name === "energy") === !graph) axes.curve(data.t, data.values[k], full.t, { energy, force, motion }[name], colour);
      });
      const [x0, y0, x1, y1] = axes.box;
      axes.ctx.fillStyle = theme.accent;
      axes.ctx.fillRect(x0 + Math.min(t / full.t, 1) * (x1 - x0) - 1, y0, 2, y1 - y0);
    });
  }
}

// Results over the speed or load, on a logarithmic axis; those that the user disturbed are hollow.
export function drawResults(canvas, results, theme) {
  if (!canvas.clientWidth || !results.length) return;
  const axes = new Axes(canvas, theme), { ctx, box: [x0, y0, x1, y1] } = axes;
  const loads = results.map((one) => one.load), low = Math.min(...loads, 5e-3) / 1.2, high = Math.max(...loads, 5e-2) * 1.2;
  const place = (load) => Math.log(load / low) / Math.log(high / low);
  const values = results.map((one) => one.value), most = Math.max(...values), ratio = results[0].result === "e";
  const bottom = ratio ? Math.max(Math.floor(10 * Math.min(...values) - 0.2) / 10, 0) : 0, top = ratio ? Math.max(1, most) : above(most);
  const ticks = [1e-4, 1e-3, 1e-2, 0.1].filter((one) => one > low && one < high).map((one) => [place(one), label(one)]);
  axes.frame({ low: bottom, high: top }, null, ticks, "");
  for (const { load, value, disturbance } of results) {
    ctx.beginPath();
    ctx.arc(x0 + place(load) * (x1 - x0), y1 - ((value - bottom) / (top - bottom)) * (y1 - y0), 4, 0, 7);
    ctx.strokeStyle = ctx.fillStyle = theme.accent;
    disturbance ? ctx.stroke() : ctx.fill();
  }
}
