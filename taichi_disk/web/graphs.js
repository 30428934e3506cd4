// Curves over time, in which a drag goes back in time, and the diagram of results. CSS draws their frames.

import { element } from "./html.js";
import { label, line, roundAbove } from "./legend.js";

const GRAPHS = [["energy"], ["force", "motion"]]; // what each graph shows, on its left and right scale

export function legend(caption, names) {
  const name = ([text, colour]) =>
    colour ? element("span", { style: `--curve: ${colour}` }, text) : text;
  caption.replaceChildren(...names.map(name));
}

// Write numbers around a plot: its scales {low, high} left and right, [fraction of the width, text] below. A rule is
// drawn at 0, or in the middle if the scales have no 0 inside; all scales have it at the same height.
function frame(plot, contents, below, ...scales) {
  const middle = ({ low, high }) => (low < 0 ? 0 : (low + high) / 2);
  const height = (scale, value) => (100 * (value - scale.low)) / (scale.high - scale.low);
  const beside = (scale, k) =>
    [scale.low, middle(scale), scale.high].map((value) => {
      const place = { className: k ? "right" : "left", style: `bottom: ${height(scale, value)}%` };
      return element("i", place, label(value));
    });
  const under = ([part, text]) => element("i", { style: `left: ${100 * part}%` }, text);
  plot.replaceChildren(...contents, ...scales.flatMap(beside), ...below.map(under));
  plot.style.setProperty("--rule-top", `${100 - height(scales[0], middle(scales[0]))}%`);
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

  // `fullForce`: a force that the scene will reach [Mc²/R]. In these units its number is smaller than the speed of a
  // throw, and similar to a compression. So no scale but that of the energies ends below it: rounding errors at the
  // start stay invisible.
  draw({ t, fullForce }, accent) {
    const { data, curves, canvases } = this;
    if (!data || !canvases[0].clientWidth) return;
    const end = (this.end = roundAbove(Math.max(1.1 * data.t.at(-1), 1)));
    canvases.forEach((canvas, k) => {
      const { clientWidth: width, clientHeight: height } = canvas,
        ctx = canvas.getContext("2d");
      Object.assign(canvas, { width: width * devicePixelRatio, height: height * devicePixelRatio });
      ctx.scale(devicePixelRatio, devicePixelRatio);
      const graphs = GRAPHS[k].map((graph) => {
        const shown = curves.filter((one) => one.graph === graph),
          values = shown.flatMap((one) => one.values);
        const first = graph === "energy" ? 0 : fullForce;
        const high = roundAbove(
          1.05 * values.reduce((most, value) => Math.max(most, Math.abs(value)), first) || 1,
        );
        return {
          shown,
          high,
          least: values.reduce((least, value) => Math.min(least, value / high), 0),
        };
      });
      const least = Math.min(...graphs.map((one) => one.least)); // some energies of a spinning disk are below 0
      const depth = [0, 0.2, 1].find((part) => least > -part - 0.005);
      const scales = graphs.map(({ shown, high }) => {
        const low = -depth * high;
        const place = (value, n) => [
          (data.t[n] / end) * width,
          ((high - value) / (high - low)) * height,
        ];
        for (const { colour, values } of shown) line(ctx, values.map(place), colour, 1.8);
        return { low, high };
      });
      line(
        ctx,
        [0, height].map((y) => [Math.min(t / end, 1) * width, y]),
        accent,
        2,
      );
      const key = JSON.stringify([end, scales]),
        times = [
          [0, "0"],
          [0.5, `${label(end / 2)} R/c`],
          [1, label(end)],
        ];
      if (key !== canvas.key) frame(canvas.parentNode, [canvas], times, ...scales);
      canvas.key = key;
    });
  }
}

// Results over the speed or load, on a logarithmic axis; those that the user disturbed are hollow.
export function showDiagram(plot, results) {
  if (!results.length) return plot.replaceChildren();
  const loads = results.map(({ load }) => load),
    values = results.map(({ value }) => value);
  const first = Math.min(...loads, 5e-3) / 1.2,
    last = Math.max(...loads, 5e-2) * 1.2;
  const part = (load) => Math.log(load / first) / Math.log(last / first),
    isRatio = results[0].result === "e";
  const low = isRatio ? Math.max(Math.floor(10 * Math.min(...values) - 0.2) / 10, 0) : 0;
  const high = isRatio ? Math.max(1, ...values) : roundAbove(Math.max(...values));
  const decades = [1e-4, 1e-3, 1e-2, 0.1].filter((load) => first < load && load < last);
  const dots = results.map(({ result, load, value, disturbance }) => {
    const style = `left: ${100 * part(load)}%; bottom: ${(100 * (value - low)) / (high - low)}%`;
    const title = `${result} = ${label(value)} at ${label(load)}`;
    return element("b", { style, title, className: disturbance && "hollow" });
  });
  frame(
    plot,
    dots,
    decades.map((load) => [part(load), label(load)]),
    { low, high },
  );
}
