// Plays the states that `taichi_disk/web/film.py` packed into this document.

import { Controls } from "./controls.js";
import { Drawing, bytes, centroid, decoded } from "./draw.js";
import { followPointers } from "./gestures.js";
import { checked, element, elements } from "./html.js";

// The states of one run.
class Recording {
  constructor(run, data) {
    const array = (name, Kind) => new Kind(data, ...run.arrays[name]), { points, disk_points } = run.scene;
    this.run = run;
    for (const name of ["motion", "forces", "centres"]) this[name] = array(name, Float32Array);
    // Numbers are differences from the state before; all low bytes of displacements come before the high bytes.
    const halves = array("displacements", Uint8Array), count = halves.length / 2;
    this.displacements = new Int16Array(count);
    for (let i = 0; i < count; i++) {
      const before = i < 2 * points ? 0 : this.displacements[i - 2 * points];
      this.displacements[i] = before + (halves[i] | (halves[count + i] << 8));
    }
    this.codes = {};
    for (const name of Object.keys(run.limits)) {
      const codes = (this.codes[name] = array(name, Uint8Array));
      for (let i = points; i < codes.length; i++) codes[i] += codes[i - points];
    }
    this.rest = decoded(run.scene.rest, Float32Array);
    this.centre = centroid(this.rest, disk_points);
    this.x = new Float32Array(2 * points);
    this.values = new Float32Array(points);
  }

  // Return the state at a place in the list of states; between two states it is interpolated.
  state(place, quantity) {
    const { run, rest, centre, displacements, x, values } = this, { points, disk_points } = run.scene;
    const k = Math.min(Math.floor(place), run.states - 1), next = Math.min(k + 1, run.states - 1), part = place - k;
    const mixed = (array, width, i) => (1 - part) * array[k * width + i] + part * array[next * width + i];
    const [cx, cy, angle] = [0, 1, 2].map((i) => mixed(this.motion, 3, i));
    const cos = Math.cos(angle), sin = Math.sin(angle);
    for (let i = 0; i < 2 * points; i++) x[i] = rest[i] + run.unit * mixed(displacements, 2 * points, i);
    for (let i = 0; i < 2 * disk_points; i += 2) {
      const dx = x[i] - centre[0], dy = x[i + 1] - centre[1];
      x[i] = cx + cos * dx - sin * dy;
      x[i + 1] = cy + sin * dx + cos * dy;
    }
    const { limit, range, signed } = run.limits[quantity], [zero, levels] = signed ? [127, 127] : [0, 255];
    for (let i = 0; i < points; i++) values[i] = (range * (mixed(this.codes[quantity], points, i) - zero)) / levels;
    const now = [0, 1].map((i) => mixed(this.centres, 2, i));
    const path = Array.from({ length: k + 1 }, (_, n) => this.centres.subarray(2 * n, 2 * n + 2));
    const forces = this.forces.subarray(3 * run.first[k], 3 * run.first[k + 1]), row = { com_x: now[0], com_y: now[1] };
    return { t: place, x, values, limit, forces, fullForce: run.scene.full_force, path: [...path, now], row };
  }
}

async function play() {
  const ui = elements(document), packed = new Blob([bytes(ui.states.textContent)]).stream();
  const data = await new Response(packed.pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
  const length = new Uint32Array(data, 0, 1)[0];
  const { runs, cues, fps } = JSON.parse(new TextDecoder().decode(data.slice(4, 4 + length)));
  const { scene } = runs[0], last = cues.length - 1, plain = (text) => text.replace(/^\*/, "");
  const settings = { ...scene.options, speed: 1 };
  let place = 0, before = 0, isPlaying, isVisible = true, isUsed = window.top === window;

  const panes = runs.map((run) => {
    const [name, ...lines] = run.scene.title, caption = element("p"), canvas = element("canvas", { role: "img" });
    canvas.ariaLabel = run.scene.title.join(", ");
    const title = element("div", {}, element("h1", {}, name), element("p", { className: "faint" }, lines.join("\n")));
    ui.disks.append(element("figure", {}, element("figcaption", {}, title, caption), canvas));
    const drawing = new Drawing(canvas);
    drawing.setScene(run.scene);
    return { drawing, caption, canvas, run, recording: new Recording(run, data.slice(4 + length)) };
  });
  const all = (act) => panes.forEach(({ drawing }) => act(drawing));
  const view = { pan: (...at) => all((one) => one.pan(...at)), zoom: (...at) => all((one) => one.zoom(...at)) };
  for (const { canvas } of panes) {
    // In a frame of a page that scrolls, the wheel zooms the film only after a press.
    canvas.addEventListener("wheel", (event) => isUsed || event.stopImmediatePropagation());
    canvas.addEventListener("pointerdown", () => (isUsed = true));
    followPointers(canvas, view, show);
    canvas.ondblclick = ui.whole.onclick = () => {
      all((one) => one.fit());
      show();
    };
  }

  function show() {
    const from = Math.floor(place), to = Math.min(from + 1, last), captions = (run) => run.captions[Math.round(place)];
    const at = cues[from] + (place - from) * (cues[to] - cues[from]);
    for (const { drawing, caption, run, recording } of panes) {
      drawing.draw(recording.state(at, settings.quantity));
      const magnified = settings.magnify > 1 ? `displacements × ${Number(settings.magnify.toPrecision(2))}` : "";
      // A blank line keeps its height.
      const word = (line) => element(line.startsWith("*") ? "b" : "span", {}, `${plain(line)}\u00a0\n`);
      caption.replaceChildren(...[...captions(run), magnified].map(word));
    }
    ui.moment.value = place;
    ui.moment.ariaValueText = captions(runs[0]).join(", ");
  }

  function change() {
    controls.show(specs.map((spec) => ({ ...spec, value: settings[spec.key] })));
    document.documentElement.style.colorScheme = settings.theme;
    all((one) => one.set({ ...settings, ...checked(ui.options) }));
    show();
  }

  function setPlaying(yes) {
    isPlaying = yes;
    ui.play.textContent = yes ? "Pause" : "Play";
  }

  const factor = { unit: "", meaning: "a factor", live: true };
  const specs = [
    { key: "quantity", name: "colours show", options: scene.quantities.map(({ name }) => name) },
    { key: "draw", name: "drawn as", options: ["field", "springs", "both", "points"] },
    { key: "theme", name: "background", options: ["light", "dark"] },
    { key: "magnify", name: "displacements ×", low: 1, high: Math.max(20, settings.magnify), ...factor },
    { key: "speed", name: "speed ×", low: 0.1, high: 2, ...factor },
  ];
  const controls = new Controls(() => ui.looks, (key, value) => {
    const { options, low, high } = specs.find((spec) => spec.key === key);
    settings[key] = options ? value : Math.min(Math.max(value, low), high);
    change();
  });
  document.querySelector("details").open = matchMedia("(min-width: 960px)").matches;
  ui.moment.max = last;
  ui.options.onchange = change;
  ui.moment.oninput = () => {
    setPlaying(false);
    place = Number(ui.moment.value);
    show();
  };
  ui.play.onclick = () => setPlaying(!isPlaying);
  new IntersectionObserver(([entry]) => (isVisible = entry.isIntersecting)).observe(document.body); // in a frame
  new ResizeObserver(show).observe(ui.disks);
  setPlaying(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  change();
  requestAnimationFrame(function next(now) {
    if (isPlaying && isVisible) {
      place += Math.min((now - before) / 1000, 0.1) * fps * settings.speed;
      if (place > last) place = 0;
      show();
    }
    before = now;
    requestAnimationFrame(next);
  });
}

play().catch((error) => document.getElementById("disks").append(`This film cannot be played: ${error.message}`));
