// Controls in HTML: sliders with a number that can be typed, choices, the list of scenes, the table of results.

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

const digits = (value) => (Number.isInteger(value) ? String(value) : String(Number(value.toPrecision(6))));
const DEGREE = 180 / Math.PI;

// A slider, logarithmic unless its range begins at 0 or below; `set` is called with the value.
export class Slider {
  constructor(key, set) {
    Object.assign(this, { key, set });
    this.range = element("input", { type: "range", min: 0, max: 1000, step: 1 });
    this.number = element("input", { type: "text", inputMode: "decimal" });
    this.name = element("span");
    this.low = element("i");
    this.high = element("i", { className: "high" });
    const track = element("div", {}, this.range, this.name, this.low, this.high);
    this.node = element("div", { className: "slider" }, track, this.number);
    this.node.dataset.key = key;
    const lead = (last) => {
      const part = this.range.value / 1000, { low, high } = this.spec;
      const value = low > 0 ? low * (high / low) ** part : low + part * (high - low);
      if (last || this.spec.live) this.set(this.whole ? Math.round(value) : Number(value.toPrecision(3)));
    };
    this.range.oninput = () => lead(false);
    this.range.onchange = () => lead(true);
    this.node.oninput = ({ target }) => (this.edited = target); // what is being typed is not written over
    const typed = (field, factor) => () => {
      this.edited = null;
      const value = Number(field.value.trim().replace(",", ".").replace("−", "-"));
      if (field.value.trim() && Number.isFinite(value)) this.set(Number((value * factor).toPrecision(6)));
      else this.show(this.spec);
    };
    this.number.onchange = typed(this.number, 1);
    if (key === "impact.angle") {
      this.degrees = element("input", { type: "text", inputMode: "decimal", className: "degrees" });
      this.degrees.onchange = typed(this.degrees, 1 / DEGREE);
      this.degrees.setAttribute("aria-label", "angle in degrees");
      this.node.append(this.degrees);
    }
  }

  show(spec) {
    const { name, unit, low, high, value, meaning, keys } = (this.spec = spec), root = this.node.getRootNode();
    const text = unit ? `${name} [${unit}]` : name;
    const part = low > 0 ? Math.log(value / low) / Math.log(high / low) : (value - low) / (high - low);
    this.whole = spec.key === "lattice.points";
    this.name.textContent = this.degrees ? `${name} [${unit}, °]` : text;
    if (root.activeElement !== this.range || spec.live) this.range.value = Math.round(1000 * part);
    this.range.ariaLabel = text;
    this.range.ariaValueText = `${digits(value)} ${unit}`;
    this.node.title = keys ? `${meaning} (keys ${keys})` : meaning;
    this.number.ariaLabel = `${text}, number`;
    if (this.edited !== this.number) this.number.value = digits(value);
    if (this.degrees && this.edited !== this.degrees) this.degrees.value = `${(value * DEGREE).toFixed(1)}°`;
    this.low.textContent = digits(low);
    this.high.textContent = digits(high);
  }
}

// A labelled list of words; it keeps its node while its words stay the same.
export class Choice {
  constructor(key, set) {
    this.select = element("select", { onchange: () => set(this.select.value) });
    this.label = element("span");
    this.node = element("label", { className: "choice" }, this.label, this.select);
    this.node.dataset.key = key;
  }

  show({ name, options, value }) {
    this.label.textContent = name;
    if (this.select.length !== options.length) {
      this.select.replaceChildren(...options.map((one) => element("option", { value: one, textContent: one })));
    }
    this.select.value = value;
  }
}

// Shows `specs` in `parent` by controls that stay for as long as their key does.
export class Group {
  constructor(parent, Kind, set) {
    Object.assign(this, { parent, Kind, set, made: new Map() });
  }

  show(specs) {
    const keys = specs.map((one) => one.key);
    if (keys.join() !== [...this.made.keys()].join()) {
      const make = (key) => this.made.get(key) ?? new this.Kind(key, (value) => this.set(key, value));
      this.made = new Map(keys.map((key) => [key, make(key)]));
      this.parent.replaceChildren(...[...this.made.values()].map((one) => one.node));
    }
    for (const spec of specs) this.made.get(spec.key).show(spec);
  }
}

export function showScenes(parent, playlist, number, play) {
  parent.replaceChildren(...playlist.map(([name, sentence], k) => {
    const entry = element("button", { onclick: () => play(k) }, element("b", { textContent: name }));
    entry.append(element("small", { textContent: sentence }));
    entry.setAttribute("aria-current", k === number);
    return entry;
  }));
}

const PAGE_KEYS = [["i u", "closer, farther"], ["g", "go to the contact"], ["Enter", "follow the disk"], ["Backspace", "see everything"],
  ["p", "save a picture (PNG)"], ["v", "begin or end a film"], ["w", "save the scene (YAML)"], ["?", "this help"]];
const GESTURES = [["drag the disk", "before the throw: turn it; later: pull its nearest point"],
  ["drag beside it", "before the throw: aim; 0.05 c for each R"], ["drag a graph", "go back in time"],
  ["right button", "move the picture; so do two fingers"], ["wheel, pinch", "closer, farther"]];

export function showHelp(parent, keys) {
  const list = (rows) => element("dl", {}, ...rows.flatMap(([term, what]) => [
    element("dt", { textContent: term }), element("dd", { textContent: what })]));
  parent.replaceChildren(element("h2", { textContent: "Mouse and fingers" }), list(GESTURES),
    element("h2", { textContent: "Keys" }), list([...keys, ...PAGE_KEYS]));
}

// ---- results

const COLUMNS = [["result", "result"], ["value", "value"], ["load", "v [c], P [Mc²/R]"], ["angle", "angle [rad]"], ["spin", "spin [c/R]"],
  ["friction", "friction μ"], ["eta_star", "η*"], ["a", "a [1/R]"], ["points", "N"], ["contact_time", "contact [R/c]"],
  ["disturbance", "disturbed"]];

export function showResults(table, results) {
  if (!results.length) return table.replaceChildren(element("caption", { textContent: "Finished experiments are listed here." }));
  const shown = COLUMNS.filter(([key]) => key === "value" || results.some((one) => one[key]));
  const cell = (one, key) => {
    const value = one[key] ?? "";
    const text = typeof value !== "number" ? value : key === "value" ? value.toFixed(6) : String(Number(value.toPrecision(5)));
    return element("td", { textContent: text, title: String(value) });
  };
  const head = element("tr", {}, ...shown.map(([, name]) => element("th", { scope: "col", textContent: name })));
  const rows = results.map((one) => element("tr", {}, ...shown.map(([key]) => cell(one, key)))).reverse();
  table.replaceChildren(element("thead", {}, head), element("tbody", {}, ...rows));
}

export function asText(results, separator) {
  const quoted = (text) => (String(text).includes(separator) ? `"${text}"` : String(text));
  const rows = results.map((one) => COLUMNS.map(([key]) => one[key] ?? ""));
  return [COLUMNS.map(([, name]) => name), ...rows].map((row) => row.map(quoted).join(separator)).join("\n") + "\n";
}

export function download(content, name, type) {
  const link = element("a", { download: name, href: URL.createObjectURL(new Blob([content], { type })) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1e4);
}
