// Curves over time, in which a drag goes back in time. CSS draws the frame of a plot.

import { element } from "./html.js";
import { label, line, roundAbove, roundBelow } from "./legend.js";

const GRAPHS = [["energy"], ["force", "motion"]]; // on the left and right scale of each graph
const TIME_STEP = 5; // the axis of time grows by this [R/c]
const CONTACT_TIME = 4; // approximate time of a contact [R/c]
const FORCE = 0.9; // approximate largest force of a throw, over its speed [M c/R]
const FLAT = 0.004; // part of the scale below which a curve is not seen
export const LETTERS = 12; // usual size of the letters [px]
const NAMES = 8.7; // width for the names of the curves, over the size of the letters
const NAMES_PART = 0.5; // at most this part of a plot's width
const LINE_HEIGHT = 1.2; // of a name, over the size of the letters
const TICKS = 3.5; // least distance of two numbers of the axis of time, over the size of the letters

// Write numbers around a plot: its scales {low, high} left and right, [fraction of the width, text]
// below. A rule is drawn in the middle of a scale, or at its 0.
export function frame(plot, contents, below, ...scales) {
  const middle = ({ low, high }) => (low < 0 ? 0 : (low + high) / 2);
  const height = (scale, value) => (100 * (value - scale.low)) / (scale.high - scale.low);
  const beside = (scale, k) =>
    [scale.low, middle(scale), scale.high].map((value) => {
      const style = `bottom: ${height(scale, value)}%`;
      return element("i", { className: k ? "right" : "left", style }, label(value));
    });
  const under = ([part, text]) => element("i", { style: `left: ${100 * part}%` }, text);
  plot.replaceChildren(...contents, ...scales.flatMap(beside), ...below.map(under));
  plot.style.setProperty("--rule-top", `${100 - height(scales[0], middle(scales[0]))}%`);
}

// Return heights [px] near the wanted ones at which names do not overlap, in a plot so high;
// `apart`: height of a name.
function spread(wanted, height, apart) {
  const order = wanted.map((_, k) => k).sort((a, b) => wanted[a] - wanted[b]);
  const places = [];
  let last = -apart / 2;
  for (const k of order) {
    places[k] = Math.max(wanted[k], last + apart);
    last = places[k];
  }
  let next = height + apart / 2;
  for (const k of order.reverse()) {
    places[k] = Math.min(places[k], next - apart);
    next = places[k];
  }
  return places;
}

export class Graphs {
  // `scrub` is called with a time since the hit began [R/c], wherever a pointer drags.
  constructor(canvases, scrub) {
    this.canvases = canvases;
    this.end = TIME_STEP; // of the axis of time [R/c]
    this.expected = { time: 0, force: 0 };
    this.letters = LETTERS; // [px]
    for (const canvas of canvases) {
      canvas.onpointerdown = canvas.onpointermove = ({ buttons, pointerId, offsetX }) => {
        if (!(buttons & 1) || !this.data) return;
        canvas.setPointerCapture(pointerId);
        const part = offsetX / this.across(canvas.clientWidth);
        scrub(Math.min(Math.max(part, 0), 1) * this.end);
      };
    }
  }

  // Return the width of the axis of time in a plot, which names follow [px].
  across(width) {
    return width - Math.min(NAMES * this.letters, NAMES_PART * width);
  }

  // `curves`: graph, name, and colours on a light and on a dark ground.
  replace(data, curves) {
    this.keep(data);
    this.data = data;
    this.curves = curves.map(([graph, name, light, dark], k) => {
      const words = { motion: data.motion[0].split(" ")[0], flight: data.flight };
      return { graph, name: words[name] ?? name, light, dark, values: data.values[k] };
    });
    const time = `at t = ${label(data.t.at(-1))} R/c`;
    GRAPHS.forEach((graphs, k) => {
      const shown = this.curves.filter(({ graph }) => graphs.includes(graph));
      const last = shown.map(({ name, values }) => `${name} ${label(values.at(-1))}`);
      this.canvases[k].ariaLabel = `${graphs.join(" and ")} over time; ${time}: ${last.join(", ")}`;
    });
  }

  // Keep the curves of a whole contact as those of the throw before, as soon as others begin.
  keep(next) {
    const { data, curves } = this;
    if (this.before && next.motion[0] !== this.before.motion) this.before = null;
    if (!data || next.motion[0] !== data.motion[0] || next.t.at(-1) >= data.t.at(-1)) return;
    const force = curves.find(({ graph }) => graph === "force").values;
    const most = force.reduce((high, value) => Math.max(high, value), 0);
    if (force.at(-1) < 0.01 * most) this.before = { t: data.t, curves, motion: data.motion[0] };
  }

  add({ t, graph }) {
    if (!this.data || t <= this.data.t.at(-1)) return;
    this.data.t.push(t);
    this.curves.forEach(({ values }, k) => values.push(graph[k]));
  }

  // Estimate at the start of a throw how long it takes [R/c], and the largest force [Mc²/R], so that
  // the axes need not grow.
  expect({ t, row }) {
    if (t > 0) return;
    const speed = Math.max(-row.com_vy, 0);
    const time = speed ? (2 * row.lowest_y) / speed + CONTACT_TIME : 0;
    this.expected = { time, force: FORCE * speed };
  }

  // `letters`: their size over the usual size.
  draw(state, theme, name, letters) {
    if (!this.data || !this.canvases[0].clientWidth) return;
    this.letters = letters * LETTERS;
    this.expect(state);
    const past = Math.max(this.data.t.at(-1), this.before?.t.at(-1) ?? 0, 1);
    const expected = Math.ceil(this.expected.time);
    this.end = past > expected ? TIME_STEP * Math.ceil(past / TIME_STEP) : expected;
    this.canvases.forEach((canvas, k) => {
      const shown = GRAPHS[k].map((graph) => this.scaled(graph, state.fullForce));
      this.drawGraph(canvas, shown, { t: state.t, theme, name });
    });
  }

  // Return the curves of a graph with the ends of their scale. `fullForce`: a force that the scene
  // will reach [Mc²/R]. In these units its number is smaller than the speed of a throw, and similar
  // to a compression. So no scale but that of the energies ends below it: rounding errors at the
  // start stay invisible.
  scaled(graph, fullForce) {
    const curves = this.curves.filter((one) => one.graph === graph);
    const before = this.before?.curves.filter((one) => one.graph === graph) ?? [];
    const values = [...curves, ...before].flatMap((one) => one.values);
    const first = { energy: 0, force: Math.max(fullForce, this.expected.force), motion: fullForce };
    const size = values.reduce((most, value) => Math.max(most, Math.abs(value)), first[graph]);
    const high = roundAbove(1.05 * size || 1);
    const least = values.reduce((low, value) => Math.min(low, value / high), 0);
    const depth = [0, 0.2, 1].find((part) => least > -part - 0.005); // spin makes energies negative
    return { curves, before, low: -depth * high, high };
  }

  drawGraph(canvas, shown, { t, theme, name }) {
    const { clientWidth: width, clientHeight: height } = canvas;
    const { data, end: last } = this;
    const ctx = canvas.getContext("2d");
    const across = this.across(width);
    const toX = (time) => Math.min(time / last, 1) * across;
    canvas.width = width * devicePixelRatio;
    canvas.height = height * devicePixelRatio;
    ctx.scale(devicePixelRatio, devicePixelRatio);
    const names = [];
    for (const { curves, before, low, high } of shown) {
      const toY = (value) => ((high - value) / (high - low)) * height;
      ctx.globalAlpha = 0.4;
      for (const { values, ...colours } of before) {
        const points = values.map((value, n) => [toX(this.before.t[n]), toY(value)]);
        line(ctx, points, colours[name], 0.15 * this.letters, [0.17, 0.33].map((part) => part * this.letters));
      }
      ctx.globalAlpha = 1;
      for (const { name: text, values, ...colours } of curves) {
        if (values.every((value) => Math.abs(value) < FLAT * high)) continue;
        const points = values.map((value, n) => [toX(data.t[n]), toY(value)]);
        line(ctx, points, colours[name], 0.15 * this.letters);
        names.push({ text, colour: colours[name], y: toY(values.at(-1)) });
      }
    }
    const present = [0, height].map((y) => [toX(t), y]);
    line(ctx, present, theme.accent, 2);
    const wanted = names.map(({ y }) => y);
    const places = spread(wanted, height, LINE_HEIGHT * this.letters);
    const end = toX(data.t.at(-1)) + 6;
    Object.assign(ctx, {
      font: `${this.letters}px system-ui, sans-serif`,
      textBaseline: "middle",
      lineWidth: 3,
    });
    names.forEach(({ text, colour }, k) => {
      Object.assign(ctx, { fillStyle: colour, strokeStyle: theme.ground });
      const x = Math.min(end, width - ctx.measureText(text).width);
      ctx.strokeText(text, x, places[k]);
      ctx.fillText(text, x, places[k]);
    });
    const step = roundBelow(Math.min((2.5 * TICKS * this.letters) / across, 1) * last);
    const ticks = Array.from({ length: Math.floor(last / step) + 1 }, (_, k) => k * step);
    const times = ticks.map((time) => [toX(time) / width, label(time)]);
    times.at(-1)[1] += " R/c";
    const scales = shown.map(({ low, high }) => ({ low, high }));
    const key = JSON.stringify([times, scales]);
    if (key !== canvas.key) frame(canvas.parentNode, [canvas], times, ...scales);
    canvas.key = key;
  }
}
