// A disk of seven points, and what users do with any page.

const POINTS = [[0, 0], [1, 0], [0.5, 0.9], [-0.5, 0.9], [-1, 0], [-0.5, -0.9], [0.5, -0.9]];
const REST = POINTS.flatMap(([x, y]) => [x + 0.1, y + 0.05]); // beside the origin
const RING = [1, 2, 3, 4, 5, 6];
const SIDES = RING.flatMap((i) => [i, (i % 6) + 1]);
const indices = (list) => packed(Uint32Array.from(list));
const ramp = (red) => packed(Uint8Array.from({ length: 768 }, (_, k) => (k % 3 ? k / 3 : red)));
const themeOf = (name) => {
  const names = ["ground", "ink", "faint", "wall", "arrow", "velocity", "rule", "accent"];
  return Object.fromEntries(names.map((one) => [one, `${one} of ${name}`]));
};
const SCENE = {
  kind: "scene",
  triangles: indices(RING.flatMap((i) => [0, i, (i % 6) + 1])),
  springs: indices([...RING.flatMap((i) => [0, i]), ...SIDES]),
  outline: indices(RING),
  edges: indices(SIDES),
  wall_surface: "",
  points: 7,
  disk_points: 7,
  rest: packed(Float32Array.from(REST)),
  wall: { kind: "rigid", edge: 0.021, decay: 0.013 },
  spoke: 2,
  view: [-1.3, 1.6, -0.1, 2.3],
  labels: { drop: "Throw", collect: "Collect e(v)", curve: "e over v", unused: "" },
  options: { draw: "both", theme: "light", quantity: "pressure", magnify: 1 },
  quantities: [
    { name: "pressure", label: "pressure", unit: "Mc²/R²", signed: true, power: 1, map: "two", low: "pull", high: "push" },
    { name: "strain", label: "strain", unit: "", signed: false, power: 1, map: "one", low: "", high: "" },
    { name: "fringes", label: "fringes", unit: "", signed: false, power: 1, map: "one", low: "", high: "" },
  ],
  maps: {
    "light two": ramp(9),
    "light one": ramp(8),
    "light two bare": ramp(7),
    "light one bare": ramp(6),
    "dark two": ramp(5),
    "dark one": ramp(4),
    "dark one bare": ramp(3),
  },
  themes: { light: themeOf("light"), dark: themeOf("dark") },
};
const get = (id) => document.getElementById(id);
const size = (id, width, height) =>
  Object.assign(get(id).style, { width: `${width}px`, height: `${height}px` });
const resize = () => stage.observers.forEach((act) => act());
const field = (name, kind, k = 0) => document.querySelectorAll(`[data-key="${name}"] input[type=${kind}]`)[k];
const type = (name, text, k) => {
  const one = field(name, "text", k);
  one.value = text;
  one.dispatchEvent(new Event("input", { bubbles: true }));
  one.dispatchEvent(new Event("change"));
};
const drag = (id, from, to, more) => {
  pointer(get(id), "pointerdown", ...from, more);
  pointer(get(id), "pointermove", ...to, more);
  pointer(get(id), more?.cancelled ? "pointercancel" : "pointerup", ...to, more);
};

// Note what a field is told to draw, how many pixels it covers, and their mean place and colour.
const noteFields = (Field) => {
  const draw = Field.prototype.draw;
  Field.prototype.draw = function (width, height, { positions, values, colours, ...more }) {
    const canvas = draw.call(this, width, height, { positions, values, colours, ...more });
    const sums = [0, 0, 0, 0, 0, 0];
    const { data } = this.image;
    for (let i = 0; i < data.length; i++) sums[i % 4] += data[i] / 255;
    for (let i = 3; i < data.length; i += 4) {
      sums[4] += (data[i] / 255) * ((i >> 2) % this.width);
      sums[5] += (data[i] / 255) * Math.floor((i >> 2) / this.width);
    }
    const place = sums.slice(4).map((sum) => rounded(sum / sums[3]));
    const mean = sums.slice(0, 3).map((sum) => rounded((255 * sum) / sums[3]));
    const words = JSON.stringify({ positions: [...positions], values: [...values], ...more }, plain);
    stage.drawn.push(`  field ${width} x ${height} ${words} ${Math.round(sums[3])} pixels at ${place} ${mean}`);
    return canvas;
  };
};
