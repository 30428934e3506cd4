// Controls in HTML: sliders with a number that can be typed, choices, the list of scenes, the table of results.

import { element } from "./html.js";

const DEGREE = 180 / Math.PI;
const digits = (value, count = 6) => String(Number(value.toPrecision(count)));

// A slider, logarithmic unless its range begins at 0 or below; `set` is called with the key and the value.
class Slider {
  constructor(key, set) {
    const number = { type: "text", inputMode: "decimal" };
    this.name = element("span");
    this.ends = [element("i"), element("i")];
    this.range = element("input", { type: "range", step: "any" });
    this.number = element("input", number);
    this.degrees = element("input", { ...number, ariaLabel: "angle in degrees" });
    const fields = key === "impact.angle" ? [this.number, this.degrees] : [this.number];
    this.node = element(
      "div",
      { className: "slider" },
      this.name,
      ...this.ends,
      this.range,
      ...fields,
    );
    const lead = () => {
      const place = Number(this.range.value),
        value = this.spec.low > 0 ? Math.exp(place) : place;
      set(key, key === "lattice.points" ? Math.round(value) : Number(digits(value, 3)));
    };
    this.range.oninput = () => this.spec.live && lead();
    this.range.onchange = lead;
    this.node.oninput = ({ target }) => (this.edited = target); // what is being typed is not written over
    this.node.onfocusout = () => (this.edited = null);
    for (const field of fields) {
      field.onchange = () => {
        this.edited = null;
        const value = parseFloat(field.value.replace(",", ".").replace("−", "-"));
        if (Number.isNaN(value)) this.show(this.spec);
        else set(key, Number(digits(field === this.degrees ? value / DEGREE : value)));
      };
    }
  }

  show(spec) {
    const { key, name, unit, low, high, value, meaning, keys, live } = (this.spec = spec);
    const text = unit ? `${name} [${unit}]` : name,
      place = low > 0 ? Math.log : Number,
      { range } = this;
    const ends = { min: place(low), max: place(high) };
    this.name.textContent = key === "impact.angle" ? `${name} [${unit}, °]` : text;
    this.node.title = keys ? `${meaning} (keys ${keys})` : meaning;
    this.ends[0].textContent = digits(low);
    this.ends[1].textContent = digits(high);
    Object.assign(range, { ...ends, ariaLabel: text, ariaValueText: `${digits(value)} ${unit}` });
    if (live || range.getRootNode().activeElement !== range) range.value = place(value);
    this.number.ariaLabel = `${text}, number`;
    if (this.edited !== this.number) this.number.value = digits(value);
    if (this.edited !== this.degrees) this.degrees.value = `${(value * DEGREE).toFixed(1)}°`;
  }
}

class Choice {
  constructor(key, set) {
    this.select = element("select", { onchange: () => set(key, this.select.value) });
    this.name = element("span");
    this.node = element("label", { className: "choice" }, this.name, this.select);
  }

  show({ name, options, value }) {
    this.name.textContent = name;
    if (!this.select.length) this.select.append(...options.map((one) => new Option(one)));
    this.select.value = value;
  }
}

// Sliders and choices, as the program describes them. `parent` returns the element for a key.
export class Controls {
  constructor(parent, set) {
    Object.assign(this, { parent, set, made: new Map() });
  }

  show(specs) {
    if (specs.map(({ key }) => key).join() !== [...this.made.keys()].join()) {
      for (const { node } of this.made.values()) node.remove();
      this.made.clear();
      for (const { key, options } of specs) {
        const control = options ? new Choice(key, this.set) : new Slider(key, this.set);
        control.node.dataset.key = key;
        this.made.set(key, control);
        this.parent(key).append(control.node);
      }
    }
    for (const spec of specs) this.made.get(spec.key).show(spec);
  }
}

export function showScenes(parent, playlist, number) {
  parent.replaceChildren(
    ...playlist.map(([name, sentence], k) => {
      const words = [element("b", {}, name), element("small", {}, sentence)];
      const entry = element("button", { ariaCurrent: k === number }, ...words);
      entry.dataset.play = k;
      return entry;
    }),
  );
}

const COLUMNS = {
  result: "result",
  value: "value",
  load: "v [c], P [Mc²/R]",
  angle: "angle [rad]",
  spin: "spin [c/R]",
  turn: "turn [rad]",
  friction: "friction μ",
  eta_star: "η*",
  a: "a [1/R]",
  points: "N",
  seed: "seed",
  contact_time: "contact [R/c]",
  disturbance: "disturbed",
};

// The newest result comes first. Each cell's `title` has all digits.
export function showResults(table, results) {
  if (!results.length)
    return table.replaceChildren(element("caption", {}, "Finished experiments are listed here."));
  const keys = Object.keys(COLUMNS).filter((key) => results.some((one) => one[key]));
  const cell = (value, key) => {
    const text =
      key === "value" ? value.toFixed(6) : typeof value === "number" ? digits(value, 5) : value;
    return element("td", { title: value }, text);
  };
  const row = (cells) => element("tr", {}, ...cells);
  const head = row(keys.map((key) => element("th", { scope: "col" }, COLUMNS[key])));
  const rows = results.map((one) => row(keys.map((key) => cell(one[key] ?? "", key)))).reverse();
  table.replaceChildren(element("thead", {}, head), element("tbody", {}, ...rows));
}

export function asText(table, separator) {
  const quoted = (text) => (text.includes(separator) ? `"${text}"` : text);
  const cells = (row) =>
    [...row.cells].map((cell) => quoted(cell.title || cell.textContent)).join(separator);
  return [...table.rows].map(cells).join("\n") + "\n";
}
