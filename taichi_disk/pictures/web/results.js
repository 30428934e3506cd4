// The table of results, and their diagram over the speed or the load.

import { digits } from "./controls.js";
import { frame } from "./graphs.js";
import { element, inks, parsed } from "./html.js";
import { label, roundAbove } from "./legend.js";

// Parameters that make a curve of its own, with their names and usual values.
const SET_COLUMNS = {
  wall: ["", "rigid"],
  a: ["a = ", 300],
  eta_star: ["η* = ", null],
  points: ["N = ", 1099],
  angle: ["angle ", 0],
  spin: ["spin ", 0],
  friction: ["μ = ", 0],
};
const SET_COLOURS = [
  ["#00806a", "#2fc79b"],
  ["#c23f00", "#ff7f50"],
  ["#1f6fb5", "#4fb3f0"],
  ["#8e5bc0", "#c9a0f0"],
  ["#8f6500", "#e0b040"],
  ["#9c3587", "#f08ad8"],
  ["#5a5d64", "#a9abb0"],
];
// decimal sign of a copied table, which a spreadsheet in the browser's language reads
const SIGN = (0.5).toLocaleString() === "0,5" ? "," : ".";
export const COPIED = `Copied, with numbers like 0${SIGN}5: paste it into a table.`;

// Return the results in sets with equal parameters: {label, colours, rows}.
export function inSets(results) {
  const sets = new Map();
  for (const row of results) {
    const key = ["result", ...Object.keys(SET_COLUMNS)].map((name) => row[name]).join();
    if (!sets.has(key)) sets.set(key, []);
    sets.get(key).push(row);
  }
  return [...sets.values()].map((rows, k) => {
    const alpha = ["", "90", "50"][Math.floor(k / SET_COLOURS.length) % 3]; // paler, when colours come again
    return { label: labelOf(rows[0]), colours: SET_COLOURS[k % SET_COLOURS.length].map((ink) => ink + alpha), rows };
  });
}

// Return the parameters of a result that are unusual, in words.
function labelOf(row) {
  const words = [];
  for (const [name, [text, usual]] of Object.entries(SET_COLUMNS)) {
    const value = row[name];
    if (value === null || value === usual) continue;
    words.push(text + (typeof value === "number" ? label(value) : `${value} wall`));
  }
  return words.join(", ");
}

// Return s = 1/√ln(4c/v), in which e² is linear by eq. (5).
const slowness = (v) => 1 / Math.sqrt(Math.log(4 / v));

// Fit eq. (5), e = d1 √(1 − d2/√ln(4c/v)): a straight line of e² over s, with weights that make it
// the fit to e.
export function fitRestitution(rows) {
  const weighted = ({ load, value }) => ({ s: slowness(load), square: value ** 2, weight: value ** -2 });
  const points = rows.map(weighted);
  const sum = (term) => points.reduce((total, point) => total + point.weight * term(point), 0);
  const all = sum(() => 1);
  const meanS = sum(({ s }) => s) / all;
  const meanSquare = sum(({ square }) => square) / all;
  const variance = sum(({ s }) => (s - meanS) ** 2);
  const slope = sum(({ s, square }) => (s - meanS) * (square - meanSquare)) / variance;
  const level = meanSquare - slope * meanS;
  if (!(variance > 1e-6 * all) || !(level > 0)) return null;
  const e = (v) => Math.sqrt(Math.max(level + slope * slowness(v), 0));
  const squares = rows.map(({ load, value }) => (value - e(load)) ** 2);
  const rms = Math.sqrt(squares.reduce((total, one) => total + one, 0) / rows.length);
  return { d1: Math.sqrt(level), d2: -slope / level, rms, e };
}

function polyline(points, colours, dash) {
  const places = points.map(([x, y]) => `${100 * x},${100 * (1 - y)}`).join(" ");
  return `<polyline points="${places}" style="${inks(...colours)}; stroke-dasharray: ${dash}"/>`;
}

const clipped = (part) => Math.min(Math.max(part, 0), 1);

// The axes of the diagram: loads on a logarithmic scale, as far as the slider goes, and the values
// of the results in that range.
class Axes {
  constructor(results, range) {
    [this.least, this.most] = range;
    this.first = this.least / 1.2;
    this.last = this.most * 1.2;
    const values = results.filter((row) => this.contains(row)).map(({ value }) => value);
    this.low = 0;
    this.high = roundAbove(Math.max(...values, 1e-4));
    if (results.at(-1).result === "e") {
      const lowest = Math.min(...values, 1);
      this.low = Math.max(Math.floor(10 * lowest - 0.2) / 10, 0);
      this.high = Math.ceil(10 * Math.max(1, ...values)) / 10;
    }
  }

  contains({ load }) {
    return load >= this.first && load <= this.last;
  }

  // Return the place of a load, from 0 to 1 in the diagram.
  across(load) {
    return Math.log(load / this.first) / Math.log(this.last / this.first);
  }

  up(value) {
    return (value - this.low) / (this.high - this.low);
  }

  // Return the curve of a function of the load.
  curve(value) {
    const loads = Array.from({ length: 41 }, (_, k) => this.least * (this.most / this.least) ** (k / 40));
    return loads.map((load) => [this.across(load), clipped(this.up(value(load)))]);
  }

  // Return the loads of the scale with their places: powers of ten.
  get decades() {
    const decades = [1e-4, 1e-3, 1e-2, 0.1, 1].filter((load) => this.contains({ load }));
    return decades.map((load) => [this.across(load), label(load)]);
  }
}

// Return the mark of a result: a dot, hollow if the user disturbed it, or an arrow at the edge.
function markOf(row, colours, axes) {
  const height = axes.up(row.value);
  const x = clipped(axes.across(row.load));
  const y = clipped(height);
  const style = `left: ${100 * x}%; bottom: ${100 * y}%; ${inks(...colours)}`;
  const title = [`${row.result} = ${label(row.value)} at ${label(row.load)}`, labelOf(row)].filter(Boolean).join(", ");
  const properties = { style, title, className: row.disturbance ? "hollow" : "" };
  if (row.load > axes.last) return element("u", properties, "▸");
  if (row.load < axes.first) return element("u", properties, "◂");
  if (y !== height) return element("u", properties, "▾");
  return element("b", properties);
}

function setName(text, fit) {
  const name = text || "the usual disk";
  if (!fit) return name;
  const d1 = fit.d1.toFixed(3);
  const d2 = fit.d2.toFixed(3);
  const rms = label(Number(fit.rms.toPrecision(2)));
  return `${name}; eq. (5): d₁ = ${d1}, d₂ = ${d2}, rms ${rms}`;
}

// Results over the speed or load, a colour for each set. The axes hold the range of the slider: a
// result beyond it is an arrow at the edge. `fitted`: whether to draw eq. (5) for every set of at
// least three impacts.
export function showDiagram(plot, caption, results, { title, range, fitted }) {
  caption.replaceChildren(title);
  if (!results.length) return plot.replaceChildren();
  const kind = results.at(-1).result;
  const shown = results.filter((row) => row.result === kind);
  const axes = new Axes(shown, range);
  const curves = [];
  const marks = [];
  for (const { label: text, colours, rows } of inSets(shown)) {
    const inside = rows.filter((row) => axes.contains(row)).sort((a, b) => a.load - b.load);
    const untouched = inside.filter(({ disturbance }) => !disturbance);
    const isFitted = fitted && kind === "e" && untouched.length > 2;
    const fit = isFitted ? fitRestitution(untouched) : null;
    if (fit) curves.push(polyline(axes.curve(fit.e), colours, "5 4"));
    else {
      const points = untouched.map(({ load, value }) => [axes.across(load), axes.up(value)]);
      curves.push(polyline(points, colours, "none"));
    }
    caption.append(element("span", { style: inks(...colours) }, setName(text, fit)));
    for (const row of rows) marks.push(markOf(row, colours, axes));
  }
  const box = `<svg viewBox="0 0 100 100" preserveAspectRatio="none">${curves.join("")}</svg>`;
  frame(plot, [parsed(box), ...marks], axes.decades, axes);
}

// ---- the table

const COLUMNS = {
  result: "result",
  value: "value",
  load: "",
  angle: "angle [rad]",
  spin: "spin [c/R]",
  turn: "turn [rad]",
  friction: "friction μ",
  wall: "wall",
  eta_star: "η*",
  a: "a [1/R]",
  points: "N",
  seed: "seed",
  contact_time: "contact [R/c]",
  disturbance: "disturbed",
};

const LOADS = { e: "v [c]", xi: "P [Mc²/R]" }; // by their results

// Return a value of the table as text: a result as far as another lattice would leave it.
function written(key, value, result) {
  if (typeof value !== "number") return value ?? "";
  if (key !== "value") return digits(value, 5);
  return result === "e" ? value.toFixed(3) : digits(value, 3);
}

// The newest result comes first. Each cell's `title` has all digits.
export function showResults(table, results) {
  const none = "Finished experiments are listed here.";
  if (!results.length) return table.replaceChildren(element("caption", {}, none));
  const keys = Object.keys(COLUMNS).filter((key) => results.some((one) => one[key]));
  const load = [...new Set(results.map(({ result }) => LOADS[result]))].join(", ");
  const row = (cells) => element("tr", {}, ...cells);
  const colours = new Map();
  for (const set of inSets(results)) {
    for (const one of set.rows) colours.set(one, set.colours);
  }
  const rows = results.map((one, k) => {
    const cell = (key) => element("td", { title: one[key] ?? "" }, written(key, one[key], one.result));
    const cells = keys.map(cell);
    cells[0].style = inks(...colours.get(one));
    const name = { ariaLabel: `remove the result ${written("value", one.value, one.result)}` };
    const remove = element("button", name, "×");
    remove.dataset.remove = k;
    return row([...cells, element("td", {}, remove)]);
  });
  const head = row(keys.map((key) => element("th", { scope: "col" }, COLUMNS[key] || load)));
  const { remove: focused } = document.activeElement.dataset;
  table.replaceChildren(element("thead", {}, head), element("tbody", {}, ...rows.reverse()));
  table.querySelector(`[data-remove="${Math.min(focused, results.length - 1)}"]`)?.focus();
}

export function asText(table, separator) {
  const quoted = (text) => (text.includes(separator) ? `"${text}"` : text);
  const local = (text) => (separator === "\t" ? text.replace(/^(-?\d+)\.(?=\d)/, `$1${SIGN}`) : text);
  const lines = [...table.rows].map((row) => {
    const cells = [...row.cells].filter((cell) => !cell.querySelector("button"));
    return cells.map((cell) => quoted(local(cell.title || cell.textContent))).join(separator);
  });
  return lines.join("\n") + "\n";
}
