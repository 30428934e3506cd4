// Plays the states that `taichi_disk/web/film.py` packed into this document.

import { Drawing, decoded, rigidMotion } from "./draw.js";

const element = (id) => document.getElementById(id);
const times = (factor) => `× ${Number(factor.toPrecision(2))}`;

// One run: {scene, states, motion, displacements, values, limits, forces, first, centres, cues, captions, curves}.
class Recording {
  constructor(run, bytes) {
    const part = (name, Kind) => new Kind(bytes, ...run.arrays[name]);
    const { points } = run.scene;
    this.run = run;
    this.motion = part("motion", Float32Array);
    this.forces = part("forces", Float32Array);
    this.centres = part("centres", Float32Array);
    // Numbers are differences from the state before; of displacements all low bytes come first.
    const planes = part("displacements", Uint8Array), half = planes.length / 2, width = 2 * points;
    this.displacements = new Int16Array(half);
    for (let i = 0; i < half; i++)
      this.displacements[i] = (i < width ? 0 : this.displacements[i - width]) + (planes[i] | (planes[half + i] << 8));
    this.values = {};
    for (const name of Object.keys(run.limits)) {
      const codes = part(name, Uint8Array);
      for (let i = points; i < codes.length; i++) codes[i] += codes[i - points];
      this.values[name] = codes;
    }
    this.rest = decoded(run.scene.rest, Float32Array);
    this.centre = rigidMotion(this.rest, this.rest, run.scene.disk_points).from;
    this.x = new Float32Array(width);
    this.shown = new Float32Array(points);
  }

  // The state between two that were packed; `place` counts them.
  state(place, quantity) {
    const { run, rest, centre, motion, displacements, x, shown } = this, { points, disk_points } = run.scene;
    const k = Math.min(Math.floor(place), run.states - 1), next = Math.min(k + 1, run.states - 1), part = place - k;
    const mixed = (array, width, i) => (1 - part) * array[k * width + i] + part * array[next * width + i];
    const [cx, cy, angle] = [0, 1, 2].map((i) => mixed(motion, 3, i)), cos = Math.cos(angle), sin = Math.sin(angle);
    for (let i = 0; i < 2 * points; i += 2) {
      let px = rest[i] + run.unit * mixed(displacements, 2 * points, i);
      let py = rest[i + 1] + run.unit * mixed(displacements, 2 * points, i + 1);
      if (i < 2 * disk_points) {
        (px -= centre[0]), (py -= centre[1]);
        [px, py] = [cx + cos * px - sin * py, cy + sin * px + cos * py];
      }
      x[i] = px;
      x[i + 1] = py;
    }
    const { limit, range, signed } = run.limits[quantity];
    for (let i = 0; i < points; i++) shown[i] = (range * (mixed(this.values[quantity], points, i) - (signed ? 127 : 0))) / (signed ? 127 : 255);
    const path = Array.from({ length: k + 1 }, (_, n) => this.centres.subarray(2 * n, 2 * n + 2));
    const now = [0, 1].map((i) => mixed(this.centres, 2, i));
    const forces = this.forces.subarray(3 * run.first[k], 3 * run.first[k + 1]);
    return { t: place, x, values: shown, limit, forces, path: [...path, now], row: { com_x: now[0], com_y: now[1] } };
  }
}

async function play() {
  const packed = new Blob([Uint8Array.from(atob(element("states").textContent), (letter) => letter.charCodeAt(0))]);
  const bytes = await new Response(packed.stream().pipeThrough(new DecompressionStream("deflate"))).arrayBuffer();
  const length = new Uint32Array(bytes, 0, 1)[0], film = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, length)));
  const recordings = film.runs.map((run) => new Recording(run, bytes.slice(4 + length)));
  const { scene } = film.runs[0], last = film.cues.length - 1, moment = element("moment");
  let place = 0, playing = !matchMedia("(prefers-reduced-motion: reduce)").matches, before = 0, visible = true, used = window.top === window;

  const drawings = film.runs.map((run) => {
    const figure = document.createElement("figure"), text = document.createElement("figcaption"), title = document.createElement("div");
    const stage = document.createElement("div"), canvas = document.createElement("canvas"), [name, ...lines] = run.scene.title;
    title.append(Object.assign(document.createElement("h1"), { textContent: run.label || name }));
    title.append(Object.assign(document.createElement("p"), { textContent: lines.join("\n") }));
    text.append(title, document.createElement("p"));
    stage.className = "stage";
    stage.append(canvas);
    figure.append(text, stage);
    element("disks").append(figure);
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", run.scene.title.join(", "));
    const drawing = new Drawing(canvas);
    drawing.setScene(run.scene);
    drawing.caption = text.lastChild;
    gestures(canvas);
    return drawing;
  });

  function show() {
    const k = Math.round(place), from = Math.floor(place), to = Math.min(from + 1, last);
    const at = film.cues[from] + (place - from) * (film.cues[to] - film.cues[from]);
    drawings.forEach((drawing, n) => {
      drawing.draw(recordings[n].state(at, drawing.options.quantity));
      const { magnify } = drawing.options, remark = magnify > 1 ? `displacements ${times(magnify)}` : "";
      drawing.caption.replaceChildren(...[...film.runs[n].captions[k], remark].map((line) => {
        const shown = document.createElement(line.startsWith("*") ? "b" : "span");
        return Object.assign(shown, { textContent: `${line.replace(/^\*/, "")}\u00a0\n` }); // a blank line keeps its height
      }));
    });
    moment.value = place;
    moment.setAttribute("aria-valuetext", film.runs[0].captions[k].join(", "));
  }

  function each(change) {
    drawings.forEach(change);
    show();
  }

  function gestures(canvas) {
    const held = new Map();
    const at = (event) => [event.offsetX, event.offsetY];
    canvas.onpointerdown = (event) => {
      used = true;
      canvas.setPointerCapture(event.pointerId);
      held.set(event.pointerId, at(event));
    };
    canvas.onpointerup = canvas.onpointercancel = (event) => held.delete(event.pointerId);
    canvas.onpointermove = (event) => {
      const old = held.get(event.pointerId), now = at(event);
      if (!old) return;
      const other = [...held].find(([id]) => id !== event.pointerId)?.[1];
      held.set(event.pointerId, now);
      const distance = ([x, y]) => Math.hypot(x - other[0], y - other[1]);
      if (other) each((drawing) => drawing.zoom(distance(now) / Math.max(distance(old), 1), ...other));
      else each((drawing) => drawing.pan(now[0] - old[0], now[1] - old[1]));
    };
    canvas.ondblclick = () => each((drawing) => drawing.fit());
    canvas.onwheel = (event) => {
      if (!used) return; // on a page that scrolls
      event.preventDefault();
      each((drawing) => drawing.zoom(1.0015 ** -event.deltaY, ...at(event)));
    };
  }

  for (const curve of Object.values(film.runs[0].curves)) {
    const points = curve.map((y, k) => `${k / last},${0.95 - 0.9 * y}`).join(" ");
    document.querySelector("svg").insertAdjacentHTML("beforeend", `<polyline points="${points}"/>`);
  }
  for (const { name, label } of scene.quantities) element("quantity").append(new Option(label.split(",")[0], name));
  const { quantity, draw, magnify, theme } = scene.options;
  Object.assign(element("quantity"), { value: quantity });
  Object.assign(element("draw"), { value: draw });
  Object.assign(element("magnify"), { max: Math.max(20, magnify), value: magnify });
  element("dark").checked = theme === "dark";
  document.querySelector("details").open = matchMedia("(min-width: 960px)").matches;
  moment.max = last;

  function apply() {
    const checked = (id) => element(id).checked, theme = checked("dark") ? "dark" : "light", size = Number(element("magnify").value);
    for (const [name, colour] of Object.entries(scene.themes[theme])) document.documentElement.style.setProperty(`--${name}`, colour);
    document.querySelector("[for=magnify]").textContent = times(size);
    const options = { quantity: element("quantity").value, draw: element("draw").value, magnify: size, theme };
    each((drawing) => drawing.set({ ...options, outline: checked("outline"), path: checked("path"), forces: checked("forces") }));
  }

  function pause(stop) {
    playing = !stop;
    element("play").textContent = playing ? "Pause" : "Play";
  }

  moment.oninput = () => {
    pause(true);
    place = Number(moment.value);
    show();
  };
  for (const id of ["quantity", "draw", "magnify", "outline", "path", "forces", "dark"]) element(id).oninput = apply;
  element("play").onclick = () => pause(playing);
  element("whole").onclick = () => each((drawing) => drawing.fit());
  element("picture").onclick = async () => {
    const lines = [...scene.title, ...film.runs[0].captions[Math.round(place)].map((line) => line.replace(/^\*/, ""))];
    const link = Object.assign(document.createElement("a"), { download: "disk.png", href: URL.createObjectURL(await drawings[0].picture(lines)) });
    link.click();
  };
  onkeydown = (event) => {
    if (event.target !== document.body) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (event.key === " ") pause(playing);
    else if (step) pause(true), (place = Math.min(Math.max(Math.round(place) + step, 0), last)), show();
    else return;
    event.preventDefault();
  };
  new IntersectionObserver(([entry]) => (visible = entry.isIntersecting)).observe(document.body); // in a frame
  new ResizeObserver(show).observe(element("disks"));
  pause(!playing);
  apply();
  requestAnimationFrame(function next(now) {
    if (playing && visible) {
      place += Math.min((now - before) / 1000, 0.1) * film.fps * element("speed").value;
      if (place > last) place = 0;
      show();
    }
    before = now;
    requestAnimationFrame(next);
  });
}

play().catch((error) => element("disks").append(`This film cannot be played: ${error.message}`));
