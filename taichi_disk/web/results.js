// The table of results, and their diagram over the speed or the load.

import { digits } from "./controls.js";
import { frame } from "./graphs.js";
import { element } from "./html.js";
import { label, roundAbove } from "./legend.js";

const SVG = "http://www.w3.org/2000/svg";

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
const SET_COLOURS = ["#00806a", "#c23f00", "#1f6fb5", "#8e5bc0", "#8f6500", "#9c3587", "#5a5d64"];

// Return the results in sets with equal parameters: {label, colour, rows}. A label names what is
// unusual.
export function inSets(results) {
  const sets = new Map();
  for (const row of results) {
    const key = ["result", ...Object.keys(SET_COLUMNS)].map((name) => row[name]).join();
    if (!sets.has(key)) sets.set(key, []);
    sets.get(key).push(row);
  }
  return [...sets.values()].map((rows, k) => {
    const words = Object.entries(SET_COLUMNS).map(([name, [text, usual]]) => {
      const value = rows[0][name];
      if (value === null || value === usual) return "";
      return text + (typeof value === "number" ? label(value) : `${value} wall`);
    });
    const colour = SET_COLOURS[k % SET_COLOURS.length];
    return { label: words.filter(Boolean).join(", "), colour, rows };
  });
}

// Fit eq. (5), e = d1 √(1 − d2/√ln(4c/v)): a straight line of e² over s = 1/√ln(4c/v), with weights
// that make it the fit to e.
export function fitRestitution(rows) {
  const points = rows.map(({ load, value }) => {
    return { s: 1 / Math.sqrt(Math.log(4 / load)), square: value ** 2, weight: value ** -2 };
  });
  const sum = (term) => points.reduce((total, point) => total + point.weight * term(point), 0);
  const all = sum(() => 1);
  const meanS = sum(({ s }) => s) / all;
  const meanSquare = sum(({ square }) => square) / all;
  const variance = sum(({ s }) => (s - meanS) ** 2);
  const slope = sum(({ s, square }) => (s - meanS) * (square - meanSquare)) / variance;
  const level = meanSquare - slope * meanS;
  if (!(variance > 1e-6 * all) || !(level > 0)) return null;
  const e = (v) => Math.sqrt(Math.max(level + slope / Math.sqrt(Math.log(4 / v)), 0));
  const errors = rows.map(({ load, value }) => value - e(load));
  const rms = Math.sqrt(errors.reduce((total, error) => total + error ** 2, 0) / rows.length);
  return { d1: Math.sqrt(level), d2: -slope / level, rms, e };
}

function polyline(points, colour, dash) {
  const curve = document.createElementNS(SVG, "polyline");
  curve.setAttribute("points", points.map(([x, y]) => `${100 * x},${100 * (1 - y)}`).join(" "));
  curve.setAttribute("style", `stroke: ${colour}; stroke-dasharray: ${dash}`);
  return curve;
}

// Results over the speed or load, on a logarithmic axis, a colour for each set; those that the user
// disturbed are hollow. The axes hold the range of the slider: a result beyond it is an arrow at the
// edge. `fitted`: whether to draw eq. (5) for every set of at least three impacts.
export function showDiagram(plot, caption, results, { title, range, fitted }) {
  caption.replaceChildren(title);
  if (!results.length) return plot.replaceChildren();
  const kind = results.at(-1).result;
  const [least, most] = range;
  const first = least / 1.2;
  const last = most * 1.2;
  const isInside = ({ load }) => load >= first && load <= last;
  const shown = results.filter((row) => row.result === kind);
  const values = shown.filter(isInside).map(({ value }) => value);
  const isRatio = kind === "e";
  const lowest = Math.min(...values, isRatio ? 1 : 0);
  const low = isRatio ? Math.max(Math.floor(10 * lowest - 0.2) / 10, 0) : 0;
  const high = isRatio ? Math.max(1, ...values) : roundAbove(Math.max(...values, 1e-4));
  const part = (load) => Math.log(load / first) / Math.log(last / first);
  const height = (value) => (value - low) / (high - low);
  const clipped = (value) => Math.min(Math.max(value, 0), 1);
  const curves = document.createElementNS(SVG, "svg");
  curves.setAttribute("viewBox", "0 0 100 100");
  curves.setAttribute("preserveAspectRatio", "none");
  const dots = [];
  for (const { label: text, colour, rows } of inSets(shown)) {
    const inside = rows.filter(isInside).sort((a, b) => a.load - b.load);
    const untouched = inside.filter(({ disturbance }) => !disturbance);
    const fit = fitted && isRatio && untouched.length > 2 ? fitRestitution(untouched) : null;
    const place = ({ load, value }) => [part(load), height(value)];
    if (fit) {
      const speeds = Array.from({ length: 41 }, (_, k) => least * (most / least) ** (k / 40));
      const points = speeds.map((load) => [part(load), clipped(height(fit.e(load)))]);
      curves.append(polyline(points, colour, "5 4"));
    } else if (untouched.length > 1) curves.append(polyline(untouched.map(place), colour, "none"));
    const words = [text || "the usual disk"];
    if (fit) {
      const [d1, d2] = [fit.d1, fit.d2].map((value) => value.toFixed(3));
      words.push(`eq. (5): d₁ = ${d1}, d₂ = ${d2}, rms ${label(Number(fit.rms.toPrecision(2)))}`);
    }
    caption.append(element("span", { style: `--curve: ${colour}` }, words.join("; ")));
    for (const row of rows) {
      const x = clipped(part(row.load));
      const y = clipped(height(row.value));
      const isMark = !isInside(row) || y !== height(row.value);
      const style = `left: ${100 * x}%; bottom: ${100 * y}%; --curve: ${colour}`;
      const words = `${kind} = ${label(row.value)} at ${label(row.load)}`;
      const shape = isMark ? (row.load > last ? "▸" : row.load < first ? "◂" : "▾") : "";
      const className = row.disturbance ? "hollow" : "";
      dots.push(element(isMark ? "u" : "b", { style, title: words, className }, shape));
    }
  }
  const decades = [1e-4, 1e-3, 1e-2, 0.1, 1].filter((load) => first < load && load < last);
  const below = decades.map((load) => [part(load), label(load)]);
  frame(plot, [curves, ...dots], below, { low, high });
}

// ---- the table

const COLUMNS = {
  result: "result",
  value: "value",
  load: "v [c], P [Mc²/R]",
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
  const row = (cells) => element("tr", {}, ...cells);
  const colours = inSets(results).flatMap((set) => set.rows.map((one) => [one, set.colour]));
  const colourOf = new Map(colours);
  const rows = results.map((one, k) => {
    const cells = keys.map((key) => {
      const text = written(key, one[key], one.result);
      return element("td", { title: one[key] ?? "" }, text);
    });
    cells[0].style = `--curve: ${colourOf.get(one)}`;
    const remove = element(
      "button",
      { ariaLabel: `remove the result ${cells[1].textContent}` },
      "×",
    );
    remove.dataset.remove = k;
    return row([...cells, element("td", {}, remove)]);
  });
  const head = row(keys.map((key) => element("th", { scope: "col" }, COLUMNS[key])));
  table.replaceChildren(element("thead", {}, head), element("tbody", {}, ...rows.reverse()));
}

export function asText(table, separator) {
  const quoted = (text) => (text.includes(separator) ? `"${text}"` : text);
  const lines = [...table.rows].map((row) => {
    const cells = [...row.cells].filter((cell) => !cell.querySelector("button"));
    return cells.map((cell) => quoted(cell.title || cell.textContent)).join(separator);
  });
  return lines.join("\n") + "\n";
}
