// Controls in HTML: sliders with a number that can be typed, and choices.

import { element } from "./html.js";

const DEGREE = 180 / Math.PI;
export const digits = (value, count = 6) => String(Number(value.toPrecision(count)));

export const notRead = (text) => `“${text.slice(0, 40)}” is not read as a number: write 0.02, 2e-2 or 1/50`;

// Return the number that a text is, as a whole: with a point or a comma, a fraction, or per cent, in c or
// without a unit; else NaN. A comma before three digits may mean thousands, so it is not read.
export function readNumber(text) {
  const dashed = text.normalize("NFKC").replace(/[\u2010-\u2015\u2212]/g, "-");
  const plain = dashed.replace(/\u200b/g, "").trim().replace(/ ?c$/i, "");
  if (plain.endsWith("%")) return readNumber(plain.slice(0, -1)) / 100;
  const parts = plain.split(/\s*[/\u2044]\s*/);
  const isNumber = (part) => /^[-+]?(\d+[.,]?\d*|[.,]\d+)(e[-+]?\d+)?$/i.test(part);
  const isUnclear = parts.some((part) => /^[-+]?[1-9]\d{0,2},\d{3}$/.test(part));
  if (!parts.every(isNumber) || isUnclear || parts.length > 2) return NaN;
  const [value, divisor = 1] = parts.map((part) => Number(part.replace(",", ".")));
  return Number.isFinite(value / divisor) ? value / divisor : NaN;
}

// A slider, logarithmic unless its range begins at 0 or below. Its place goes from 0 to 100, because
// Firefox's arrow keys take steps of 1. `set` is called with the key and the value, `say` with a sentence
// about a text that is no number.
class Slider {
  constructor(key, set, say) {
    this.name = element("span");
    this.symbol = element("small");
    this.ends = [element("i"), element("i")];
    this.range = element("input", { type: "range", step: "any", min: 0, max: 100 });
    this.number = element("input", { type: "text" });
    this.degrees = element("input", { type: "text", ariaLabel: "angle in degrees" });
    const fields = key === "impact.angle" ? [this.number, this.degrees] : [this.number];
    const words = element("span", {}, this.name, " ", this.symbol);
    this.node = element("div", { className: "slider" }, words, ...this.ends, this.range, ...fields);
    const lead = () => {
      const { low, high } = this.spec;
      const part = this.range.value / 100;
      const value = low > 0 ? low * (high / low) ** part : low + (high - low) * part;
      const rounded = key === "lattice.points" ? Math.round(value) : Number(digits(value, 3));
      set(key, { 0: low, 1: high }[part] ?? rounded); // the ends exactly
    };
    this.range.oninput = () => this.spec.live && lead();
    this.range.onchange = lead;
    this.range.onpointerdown = () => (this.before = [this.range.value, this.spec.value]);
    // A finger that scrolls the page from here on changes nothing.
    this.range.onpointercancel = () => {
      this.range.value = this.before[0];
      if (this.spec.live) set(key, this.before[1]);
    };
    // What is being typed is not written over.
    this.node.oninput = ({ target }) => (this.edited = target);
    this.node.onfocusout = () => (this.edited = null);
    for (const field of fields) {
      field.onchange = () => {
        this.edited = null;
        const value = readNumber(field.value.replace(/\s*°$/, ""));
        if (Number.isNaN(value)) {
          say(notRead(field.value));
          this.show(this.spec);
        } else set(key, Number(digits(field === this.degrees ? value / DEGREE : value)));
      };
    }
  }

  show(spec) {
    const { key, name, symbol = "", unit, low, high, value, meaning, keys, live } = spec;
    this.spec = spec;
    const { range } = this;
    const inUnit = key === "impact.angle" ? "[rad, °]" : unit && `[${unit}]`;
    const text = [name, symbol, inUnit].filter(Boolean).join(" ");
    const part = low > 0 ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
    this.name.textContent = name;
    this.symbol.textContent = `${symbol} ${inUnit}`.trim();
    this.number.inputMode = this.degrees.inputMode = low < 0 ? "text" : "decimal"; // for a minus
    this.node.title = keys ? `${meaning} (keys ${keys})` : meaning;
    this.ends[0].textContent = digits(low);
    this.ends[1].textContent = digits(high);
    Object.assign(range, { ariaLabel: text, ariaValueText: `${digits(value)} ${unit}` });
    if (live || range.getRootNode().activeElement !== range) range.value = 100 * part;
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
  constructor(parent, set, say) {
    Object.assign(this, { parent, set, say, made: new Map() });
  }

  show(specs) {
    if (specs.map(({ key }) => key).join() !== [...this.made.keys()].join()) {
      for (const { node } of this.made.values()) node.remove();
      this.made.clear();
      for (const { key, options } of specs) {
        const control = options ? new Choice(key, this.set) : new Slider(key, this.set, this.say);
        control.node.dataset.key = key;
        this.made.set(key, control);
        this.parent(key).append(control.node);
      }
    }
    for (const spec of specs) this.made.get(spec.key).show(spec);
  }
}
