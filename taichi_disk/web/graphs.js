// Curves over time, in which a drag goes back in time. CSS draws the frame of a plot.

import { element, inks } from "./html.js";
import { label, line, roundAbove } from "./legend.js";

const GRAPHS = [["energy"], ["force", "motion"]]; // on the left and right scale of each graph
const TIME_STEP = 5; // the axis of time grows by this [R/c]
const LETTERS = 12; // size of the letters [px]
const NAMES = 8.7; // width for the names of the curves, over the size of the letters
const LINE_HEIGHT = 1.2; // of a name, over the size of the letters
const WIDE = 160; // axis of time with room for a number in its middle [px]

// Write names, each with the curve whose colours it has, if any.
export function legend(caption, names) {
  const name = ([text, curve]) => {
    if (!curve) return text;
    const [, , light, dark] = curve;
    return element("span", { style: inks(light, dark) }, text);
  };
  caption.replaceChildren(...names.map(name));
}

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
    this.letters = LETTERS; // [px]
    for (const canvas of canvases) {
      canvas.onpointerdown = canvas.onpointermove = ({ buttons, pointerId, offsetX }) => {
        if (!(buttons & 1) || !this.data) return;
        canvas.setPointerCapture(pointerId);
        const part = offsetX / (canvas.clientWidth - NAMES * this.letters);
        scrub(Math.min(Math.max(part, 0), 1) * this.end);
      };
    }
  }

  // `curves`: graph, name, and colours on a light and on a dark ground.
  replace(data, curves) {
    this.data = data;
    this.curves = curves.map(([graph, name, light, dark], k) => {
      const words = graph === "motion" ? data.motion[0].split(" ")[0] : name;
      return { graph, name: words, light, dark, values: data.values[k] };
    });
    const last = this.curves.map(({ name, values }) => `${name} ${label(values.at(-1))}`);
    const time = `at t = ${label(data.t.at(-1))} R/c`;
    this.canvases[0].ariaLabel = `energies over time; ${time}: ${last.slice(0, 5).join(", ")}`;
    this.canvases[1].ariaLabel = `force and motion; ${time}: ${last.slice(5).join(", ")}`;
  }

  add({ t, graph }) {
    if (!this.data || t <= this.data.t.at(-1)) return;
    this.data.t.push(t);
    this.curves.forEach(({ values }, k) => values.push(graph[k]));
  }

  // `letters`: their size over the usual size.
  draw(state, theme, name, letters) {
    if (!this.data || !this.canvases[0].clientWidth) return;
    this.letters = letters * LETTERS;
    this.end = TIME_STEP * Math.max(Math.ceil((1.02 * this.data.t.at(-1)) / TIME_STEP), 1);
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
    const values = curves.flatMap((one) => one.values);
    const first = graph === "energy" ? 0 : fullForce;
    const size = values.reduce((most, value) => Math.max(most, Math.abs(value)), first);
    const high = roundAbove(1.05 * size || 1);
    const least = values.reduce((low, value) => Math.min(low, value / high), 0);
    const depth = [0, 0.2, 1].find((part) => least > -part - 0.005); // spin makes energies negative
    return { curves, low: -depth * high, high };
  }

  drawGraph(canvas, shown, { t, theme, name }) {
    const { clientWidth: width, clientHeight: height } = canvas;
    const { data, end } = this;
    const ctx = canvas.getContext("2d");
    const across = width - NAMES * this.letters;
    const toX = (time) => Math.min(time / end, 1) * across;
    canvas.width = width * devicePixelRatio;
    canvas.height = height * devicePixelRatio;
    ctx.scale(devicePixelRatio, devicePixelRatio);
    const names = [];
    for (const { curves, low, high } of shown) {
      const toY = (value) => ((high - value) / (high - low)) * height;
      for (const { name: text, values, ...colours } of curves) {
        const points = values.map((value, n) => [toX(data.t[n]), toY(value)]);
        line(ctx, points, colours[name], 1.8);
        const isFlat = values.every((value) => Math.abs(value) < 0.004 * high);
        if (!isFlat) names.push({ text, colour: colours[name], y: toY(values.at(-1)) });
      }
    }
    const present = [0, height].map((y) => [toX(t), y]);
    line(ctx, present, theme.accent, 2);
    const wanted = names.map(({ y }) => y);
    const places = spread(wanted, height, LINE_HEIGHT * this.letters);
    const x = toX(data.t.at(-1)) + 6;
    Object.assign(ctx, {
      font: `${this.letters}px system-ui, sans-serif`,
      textBaseline: "middle",
      lineWidth: 3,
    });
    names.forEach(({ text, colour }, k) => {
      Object.assign(ctx, { fillStyle: colour, strokeStyle: theme.ground });
      ctx.strokeText(text, x, places[k]);
      ctx.fillText(text, x, places[k]);
    });
    const part = across / width;
    const times = [
      [0, "0"],
      [part, `${label(end)} R/c`],
    ];
    if (across > WIDE) times.push([0.5 * part, label(end / 2)]);
    const scales = shown.map(({ low, high }) => ({ low, high }));
    const key = JSON.stringify([times, scales]);
    if (key !== canvas.key) frame(canvas.parentNode, [canvas], times, ...scales);
    canvas.key = key;
  }
}
