// Curves over time, in which a drag goes back in time, and the diagram of results. CSS draws their frames.

import { element } from "./html.js";
import { label, line, roundAbove } from "./legend.js";

const GRAPHS = [["energy"], ["force", "motion"]]; // what each graph shows, on its left and right scale

export function legend(caption, names) {
  const name = ([text, colour]) => (colour ? element("span", { style: `--curve: ${colour}` }, text) : text);
  caption.replaceChildren(...names.map(name));
}

// Return the numbers around a plot: scales {low, high} at its left and right, [fraction of the width, text] below it.
function numbers(below, ...scales) {
  const beside = ({ low, high }, k) => [0, 0.5, 1].map((part) => {
    const place = { className: k ? "right" : "left", style: `bottom: ${100 * part}%` };
    return element("i", place, label(low + part * (high - low)));
  });
  const under = ([part, text]) => element("i", { style: `left: ${100 * part}%` }, text);
  return [...scales.flatMap(beside), ...below.map(under)];
}

export class Graphs {
  // `scrub` is called with a time since the hit began [R/c], wherever a pointer drags.
  constructor(canvases, scrub) {
    this.canvases = canvases;
    for (const canvas of canvases) {
      canvas.onpointerdown = canvas.onpointermove = ({ buttons, pointerId, offsetX }) => {
        if (!(buttons & 1) || !this.data) return;
        canvas.setPointerCapture(pointerId);
        scrub(Math.min(Math.max(offsetX / canvas.clientWidth, 0), 1) * this.end);
      };
    }
  }

  replace(data, curves) {
    this.data = data;
    this.curves = curves.map(([graph, , colour], k) => ({ graph, colour, values: data.values[k] }));
  }

  add({ t, graph }) {
    if (!this.data || t <= this.data.t.at(-1)) return;
    this.data.t.push(t);
    this.curves.forEach(({ values }, k) => values.push(graph[k]));
  }

  draw(t, accent) {
    const { data, curves, canvases } = this;
    if (!data || !canvases[0].clientWidth) return;
    const largest = ({ values }) => values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    const end = (this.end = roundAbove(Math.max(1.1 * data.t.at(-1), 1)));
    canvases.forEach((canvas, k) => {
      const { clientWidth: width, clientHeight: height } = canvas, ctx = canvas.getContext("2d");
      Object.assign(canvas, { width: width * devicePixelRatio, height: height * devicePixelRatio });
      ctx.scale(devicePixelRatio, devicePixelRatio);
      const scales = GRAPHS[k].map((graph) => {
        const own = curves.filter((one) => one.graph === graph);
        const high = roundAbove(1.05 * Math.max(...own.map(largest)) || 1);
        const low = k && data.motion[1] === "c" ? -high : 0; // a velocity has both signs
        const place = (value, n) => [(data.t[n] / end) * width, ((high - value) / (high - low)) * height];
        for (const { colour, values } of own) line(ctx, values.map(place), colour, 1.8);
        return { low, high };
      });
      line(ctx, [0, height].map((y) => [Math.min(t / end, 1) * width, y]), accent, 2);
      const key = JSON.stringify([end, scales]), times = [[0, "0"], [0.5, label(end / 2)], [1, `${label(end)} R/c`]];
      if (key !== canvas.key) canvas.parentNode.replaceChildren(canvas, ...numbers(times, ...scales));
      canvas.key = key;
    });
  }
}

// Results over the speed or load, on a logarithmic axis; those that the user disturbed are hollow.
export function showDiagram(plot, results) {
  if (!results.length) return plot.replaceChildren();
  const loads = results.map(({ load }) => load), values = results.map(({ value }) => value);
  const first = Math.min(...loads, 5e-3) / 1.2, last = Math.max(...loads, 5e-2) * 1.2;
  const part = (load) => Math.log(load / first) / Math.log(last / first), isRatio = results[0].result === "e";
  const low = isRatio ? Math.max(Math.floor(10 * Math.min(...values) - 0.2) / 10, 0) : 0;
  const high = isRatio ? Math.max(1, ...values) : roundAbove(Math.max(...values));
  const decades = [1e-4, 1e-3, 1e-2, 0.1].filter((load) => first < load && load < last);
  const dots = results.map(({ result, load, value, disturbance }) => {
    const style = `left: ${100 * part(load)}%; bottom: ${(100 * (value - low)) / (high - low)}%`;
    const title = `${result} = ${label(value)} at ${label(load)}`;
    return element("b", { style, title, className: disturbance && "hollow" });
  });
  plot.replaceChildren(...numbers(decades.map((load) => [part(load), label(load)]), { low, high }), ...dots);
}
