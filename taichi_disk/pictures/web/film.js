// Plays the states that `taichi_disk/pictures/web/film.py` packed into this document.

import { Controls } from "./controls.js";
import { Drawing, bytes, decoded } from "./draw.js";
import { followPointers } from "./gestures.js";
import { checked, element, elements, inks, parsed } from "./html.js";
import { FONT, arrow, label, line, roundAbove, roundBelow, write } from "./legend.js";
import { Throws } from "./throws.js";

const VELOCITY_ARROW = 0.7; // length of the arrow of the speed before an impact [R]
const SLOW = 0.02; // a smaller part of that speed has no arrow
const COMING = { light: "#b8b8b7", dark: "#54575e" }; // colours of curves still to come
const DASHES = [[], [5, 3], [1, 3], [9, 3, 1, 3]]; // of the curves of compared runs
const CLEAR = 0.15; // part of an axis beside which another number has room
const WIDE = 160; // axis of time with room for a number in its middle [px]
const LONG = 26; // number of letters of what is no value
const LOW = 230; // a lower picture has no room for a legend [px]
const STACKED = "(max-width: 599px) and (min-height: 701px)"; // disks one above the other

// Return the value of a list at a place between two whole numbers.
function between(values, place) {
  const k = Math.floor(place);
  const next = values[Math.min(k + 1, values.length - 1)];
  return values[k] + (place - k) * (next - values[k]);
}

// Return the numbers of 16 bits whose low bytes are the first half, and high bytes the second.
function joined(bytes) {
  const count = bytes.length / 2;
  const numbers = new Int16Array(count);
  for (let i = 0; i < count; i++) numbers[i] = bytes[i] | (bytes[count + i] << 8);
  return numbers;
}

// Turn differences from the state before, `size` numbers each, into the states.
function summed(numbers, size) {
  for (let i = size; i < numbers.length; i++) numbers[i] += numbers[i - size];
  return numbers;
}

// The states of one run. A throw (`Again`) has the same attributes and `state`:
//   times: of the states; cues: the place in that list, of each picture; end: of the run
//   curves: over `times`; captions: the changing words of each picture, in lines
//   strengths: how many times stronger each picture shows the ringing
//   edge: height of the wall's drawn edge; magnify: factor on displacements
class Recording {
  constructor(run, data, { times, cues, curves, end }) {
    const { wall, options, points } = run.scene;
    Object.assign(this, { times, cues, curves, end, captions: run.captions });
    Object.assign(this, { edge: wall.edge, magnify: options.magnify, strengths: run.strengths });
    const array = (name, Kind) => new Kind(data, ...run.arrays[name]);
    this.run = run;
    for (const name of ["forces", "centres", "velocities"]) this[name] = array(name, Float32Array);
    this.displacements = summed(joined(array("displacements", Uint8Array)), 2 * points);
    this.codes = {};
    for (const name of Object.keys(run.limits)) this.codes[name] = summed(array(name, Uint8Array), points);
    this.rest = decoded(run.scene.rest, Float32Array);
    this.x = new Float32Array(2 * points);
    this.values = new Float32Array(points);
  }

  // Return the state at a place in the list of states; between two states it is interpolated.
  state(place, quantity) {
    const { run, rest, displacements, x } = this;
    const k = Math.floor(place);
    const next = Math.min(k + 1, run.states - 1);
    const part = place - k;
    const mixed = (array, width, i) =>
      (1 - part) * array[k * width + i] + part * array[next * width + i];
    for (let i = 0; i < x.length; i++) x[i] = rest[i] + run.unit * mixed(displacements, x.length, i);
    this.colour(mixed, quantity);
    const now = [0, 1].map((i) => mixed(this.centres, 2, i));
    const past = (_, n) => this.centres.subarray(2 * n, 2 * n + 2);
    return {
      t: place,
      x,
      values: this.values,
      limit: run.limits[quantity].limit,
      forces: this.forces.subarray(3 * run.first[k], 3 * run.first[k + 1]),
      fullForce: run.scene.full_force,
      path: [...Array.from({ length: k + 1 }, past), now],
      row: { com_x: now[0], com_y: now[1] },
      velocity: [0, 1].map((i) => mixed(this.velocities, 2, i) / run.full_speed),
    };
  }

  // Set the values of the coloured quantity.
  colour(mixed, quantity) {
    const { points } = this.run.scene;
    const { unit, zero } = this.run.limits[quantity];
    const codes = this.codes[quantity];
    for (let i = 0; i < points; i++) this.values[i] = unit * (mixed(codes, points, i) - zero);
  }
}

// Draws the disk of one run. Disks that stand one above the other share the scale of the lowest.
class Pane extends Drawing {
  hasLegend = true;

  get footer() {
    return this.hasLegend ? super.footer : 0;
  }

  drawLegend(state, theme) {
    if (this.hasLegend) super.drawLegend(state, theme);
  }

  // Draw the velocity of the centre of mass, in parts of the speed before the impact.
  drawVelocity(centre, [vx, vy], theme) {
    if (Math.hypot(vx, vy) < SLOW) return;
    const tip = [centre[0] + VELOCITY_ARROW * vx, centre[1] + VELOCITY_ARROW * vy];
    const ends = [this.toScreen(...centre), this.toScreen(...tip)];
    arrow(this.context, ...ends, 5, theme.velocity, theme.ground);
  }
}

// Return a short line with the dash of a run.
const stroke = (dash) =>
  parsed(`<svg width="30" height="8"><path d="M1 4H29" fill="none" stroke="currentColor" stroke-width="2" stroke-dasharray="${dash}"/></svg>`);

// Curves of the velocity, the force and the energies over time, grey where they are still to come.
// Those of each run have a dash of its own.
class Curves {
  // before: the throw before, whose motion and force are dotted
  constructor(canvas, names, { titles, unit, runs }, { curves, times, end }, before) {
    const first = Math.max(times[0], 0);
    const last = Math.min(times.at(-1), end);
    const moments = times.map((t) => Math.min(Math.max(t, first), last)); // others are flights
    Object.assign(this, { canvas, first, last, moments, unit, before });
    canvas.ariaLabel = `${titles.join(", ")} over time`;
    this.panels = titles.map((title, k) => new Panel(title, curves, before?.curves ?? [], k));
    names.replaceChildren();
    const isCompared = runs.length > 1;
    runs.forEach(({ scene }, k) => {
      if (isCompared) names.append(stroke(DASHES[k]), element("span", {}, scene.title[0]), " ");
    });
    const named = new Map(curves.map(({ name, colours }) => [name, colours]));
    named.delete("");
    for (const [name, colours] of named) {
      names.append(element("span", { style: inks(...colours) }, name), " ");
    }
  }

  draw(place, theme, colours) {
    const { canvas, panels } = this;
    const { clientWidth: width, clientHeight: height } = canvas;
    canvas.width = width * devicePixelRatio;
    canvas.height = height * devicePixelRatio;
    const ctx = canvas.getContext("2d");
    ctx.scale(devicePixelRatio, devicePixelRatio);
    ctx.font = FONT;
    const isTall = height > width;
    const across = isTall ? width : width / panels.length;
    const down = isTall ? height / panels.length : height;
    panels.forEach((panel, k) => {
      const left = isTall ? 0 : k * across;
      const top = isTall ? k * down : 0;
      this.drawPanel(ctx, panel, [left, top, across, down], place, theme, colours);
    });
  }

  drawPanel(ctx, panel, [start, top, across, down], place, theme, colours) {
    const { title, curves, ticks, earlier } = panel;
    const { first, last, moments, unit } = this;
    const high = ticks.at(-1);
    const low = ticks[0];
    const isClear = (value) => !value || Math.abs(value) > CLEAR * (high - low);
    const numbers = ticks.map((value) => (isClear(value) ? label(value) : ""));
    const widths = numbers.map((text) => ctx.measureText(text).width);
    const left = start + Math.max(...widths) + 14;
    const width = start + across - 12 - left;
    const height = down - 46;
    const column = (t) => left + (width * (t - first)) / (last - first);
    const row = (value) => top + 24 + ((high - value) / (high - low)) * height;
    ticks.forEach((value, k) => {
      line(ctx, [[left, row(value)], [left + width, row(value)]], colours.rule, 1);
      write(ctx, numbers[k], left - 5, row(value) + 4, { textAlign: "right", theme: colours });
    });
    const step = roundBelow((last - first) / (width < WIDE ? 1 : 2.5));
    const most = step * Math.floor(last / step + 1e-6);
    for (let t = step * Math.ceil(first / step); t <= most * 1.001; t += step) {
      const number = label(Number(t.toPrecision(6)));
      const text = t > most - step / 2 ? `${number} ${unit}` : number;
      write(ctx, text, column(t), top + down - 7, { theme: colours });
    }
    Object.assign(ctx, { textAlign: "left", fillStyle: colours.ink });
    const words = [title, title.split(" [")[0], title.split(" ")[0]];
    const room = start + across - 12 - (start + 12);
    const shown = words.find((text) => ctx.measureText(text).width < room) ?? words[2];
    ctx.fillText(shown, start + 12, top + 13);
    for (const { values, colours: pair } of earlier) {
      const points = values.map((value, k) => [this.before.times[k], value]);
      const seen = points.filter(([t]) => t >= first && t <= last);
      const drawn = seen.map(([t, value]) => [column(t), row(value)]);
      line(ctx, drawn, pair[Number(theme === "dark")], 1.4, DASHES[2]);
    }
    for (const { values, colours: pair, run } of curves) {
      const points = values.map((value, k) => [column(moments[k]), row(value)]);
      const now = [column(between(moments, place)), row(between(values, place))];
      const next = Math.floor(place) + 1;
      line(ctx, [now, ...points.slice(next)], COMING[theme], 1.6, DASHES[run]);
      line(ctx, [...points.slice(0, next), now], pair[Number(theme === "dark")], 2, DASHES[run]);
    }
    const now = column(between(moments, place));
    line(ctx, [[now, top + 20], [now, top + 24 + height]], colours.faint, 1);
  }
}

// The curves of one panel, and the values that its axis names.
class Panel {
  constructor(title, curves, before, number) {
    this.title = title;
    this.curves = curves.filter(({ panel }) => panel === number);
    this.earlier = before.filter(({ panel }) => panel === number && number < 2);
    const values = [...this.curves, ...this.earlier].flatMap((one) => one.values);
    const most = values.reduce((high, value) => Math.max(high, value), 0);
    const least = values.reduce((low, value) => Math.min(low, value), 0);
    const size = Math.max(most, -least) || 1;
    const ticks = new Set([0]);
    if (least < -0.02 * size) ticks.add(-roundAbove(-least));
    if (most > 0.02 * size || !least) ticks.add(roundAbove(most || 1));
    this.ticks = [...ticks].sort((one, other) => one - other);
  }
}

async function unpacked(text) {
  const stream = new Blob([bytes(text)]).stream();
  const inflated = stream.pipeThrough(new DecompressionStream("deflate"));
  const data = await new Response(inflated).arrayBuffer();
  const length = new Uint32Array(data, 0, 1)[0];
  const head = JSON.parse(new TextDecoder().decode(data.slice(4, 4 + length)));
  return { head, data: data.slice(4 + length) };
}

// Return a line of a title whose values are not broken; a sentence may be.
function unbroken(line) {
  const className = (word) => (word.length < LONG ? "whole" : "");
  const words = line.split("    ").map((word) => element("em", { className: className(word) }, word));
  return [...words.flatMap((word) => [word, "   "]), "\n"];
}

// Return a line of a caption without the mark of its kind.
const bare = (text) => text.replace(/^[*+]/, "");

// Return the elements of one line of a caption. A blank line keeps its height.
function captionLine(text) {
  const plain = `${bare(text) || "\u00a0"}\n`;
  if (text.startsWith("+")) return element("em", { className: "motion" }, plain);
  return element(text.startsWith("*") ? "b" : "em", {}, plain);
}

// Return the words of a picture: the lines of a caption, of which the last says what is magnified.
function captionOf([...lines], magnified) {
  const magnify = Number(magnified.toPrecision(2));
  if (magnify > 1) lines.push(lines.pop() || `displacements × ${magnify}`);
  const shown = lines.map(captionLine);
  // A small comparison has no room for these lines.
  shown.at(-2).classList.add("scales", "pace");
  shown.at(-1).classList.add("scales", "remark");
  return shown;
}

// Add the figure of a run to those of others, and return its parts: the drawing, and where words stand.
function paneOf(run, disks) {
  const caption = element("p");
  const canvas = element("canvas", { role: "img" });
  const words = element("p", { className: "faint" });
  const title = element("div", {}, element("h1", {}, run.scene.title[0]), words);
  const figure = element("figure", {}, element("figcaption", {}, title, caption), canvas);
  disks.append(figure);
  const drawing = new Pane(canvas);
  drawing.setScene(run.scene);
  return { drawing, figure, caption, canvas, words, run };
}

// Return what the user can set, as `Controls` shows it.
function settable(scene) {
  const factor = { unit: "", meaning: "a factor", live: true };
  const most = Math.max(20, scene.options.magnify);
  return [
    { key: "quantity", name: "colours show", options: scene.quantities.map(({ name }) => name) },
    { key: "draw", name: "drawn as", options: ["field", "springs", "both", "points"] },
    { key: "theme", name: "background", options: ["light", "dark"] },
    { key: "magnify", name: "displacements ×", low: 1, high: most, ...factor },
    { key: "speed", name: "film speed ×", low: 0.1, high: 2, ...factor },
  ];
}

async function play() {
  const ui = elements(document);
  const { head, data } = await unpacked(ui.states.textContent);
  const { runs, fps } = head;
  const { scene } = runs.at(0); // fails here, with a word, in browsers that lack it
  const last = head.cues.length - 1;
  const settings = { ...scene.options, speed: 1 };
  let curves;
  let throws;
  let place = 0;
  let before = 0;
  let isPlaying;
  let held; // place, and whether it played, before a finger came
  let isVisible = true;
  let isUsed = false;
  const main = document.querySelector("main");
  const isScrolled = () => window.top !== window || main.scrollHeight > main.clientHeight;

  const saved = document.querySelectorAll("#disks figure, #line button, .slider, .choice"); // by a browser
  saved.forEach((one) => one.remove());
  const panes = runs.map((run) => paneOf(run, ui.disks));
  const all = (act) => panes.forEach(({ drawing }) => act(drawing));
  const view = {
    pan: (...at) => all((one) => one.pan(...at)),
    zoom: (...at) => all((one) => one.zoom(...at)),
  };
  for (const { canvas } of panes) {
    // Where a page scrolls, the wheel zooms the film only after a press.
    canvas.addEventListener("wheel", (event) => isUsed || !isScrolled() || event.stopImmediatePropagation());
    canvas.addEventListener("pointerdown", () => (isUsed = true));
    followPointers(canvas, view, show);
    canvas.ondblclick = ui.whole.onclick = seeAll;
  }

  function seeAll() {
    all((one) => one.fit());
    show();
  }

  // Show the states of `recordings`, one in each pane, with dotted curves of a throw before.
  function take(recordings, earlier) {
    const automatic = panes[0].recording?.magnify ?? settings.magnify;
    panes.forEach((pane, k) => {
      const recording = recordings[k];
      const words = recording.title ?? pane.run.scene.title;
      pane.words.replaceChildren(...words.slice(1).flatMap(unbroken));
      pane.canvas.ariaLabel = words.join(", ");
      pane.recording = recording;
      pane.drawing.scene.wall.edge = recording.edge;
    });
    if (settings.magnify === automatic) settings.magnify = recordings[0].magnify;
    curves = new Curves(ui.curves, ui.names, head, recordings[0], earlier);
  }

  function show() {
    if (!curves) return; // the first throw is not computed yet
    const [{ recording: main }] = panes;
    const at = between(main.cues, place);
    const words = main.captions[Math.round(place)];
    for (const { drawing, caption, run, recording } of panes) {
      const state = recording.state(at, settings.quantity);
      const lines = recording.captions[Math.round(place)];
      const ringing = between(recording.strengths, place);
      const { power } = scene.quantities.find(({ name }) => name === settings.quantity);
      // The numbers of the scale change only once, with the remark on the ringing.
      const full = lines.at(-1) ? Math.max(...recording.strengths) : 1;
      // first, because it may change the canvas's height
      caption.replaceChildren(...captionOf(lines, settings.magnify));
      const arrow = run.full_speed && ui.velocity.checked ? state.velocity : null;
      drawing.set({ arrow, ringing });
      const limits = { limit: state.limit / ringing ** power, written: state.limit / full ** power };
      drawing.draw({ ...state, ...limits });
    }
    curves.draw(at, settings.theme, scene.themes[settings.theme]);
    if (throws && words[1].startsWith("*")) throws.judge(main.flight);
    ui.moment.value = place;
    ui.moment.ariaValueText = words.filter(Boolean).map(bare).join(", ");
  }

  function change(theme = settings.theme) {
    settings.theme = theme;
    controls.show(specs.map((spec) => ({ ...spec, value: settings[spec.key] })));
    document.documentElement.dataset.theme = theme;
    document.documentElement.style.setProperty("--velocity", scene.themes[theme].velocity);
    all((one) => one.set({ ...settings, ...checked(ui.options) }));
    show();
  }

  // Show a throw that the page has computed, from its beginning.
  function takeThrow(one) {
    const earlier = panes[0].recording;
    take([one], earlier);
    place = 0;
    change();
    if (earlier) setPlaying(true);
  }

  function arrange() {
    panes.forEach(({ drawing, figure }, k) => {
      const isStacked = matchMedia(STACKED).matches;
      const isLast = !isStacked || k === panes.length - 1;
      drawing.hasLegend = isLast && ui.disks.clientHeight >= LOW;
      // All disks have the same height, beside that of the legend.
      figure.style.flexBasis = isStacked ? `${drawing.footer}px` : "";
      if (drawing.camera.home && drawing.width) drawing.fit();
    });
    show();
  }

  function setPlaying(yes) {
    if (yes && place === last) place = 0;
    isPlaying = yes;
    ui.play.textContent = yes ? "Pause" : "Play";
  }

  function goTo(moment) {
    setPlaying(false);
    place = moment;
    show();
  }

  const specs = settable(scene);
  const controls = new Controls(
    () => ui.looks,
    (key, value) => {
      const { options, low, high } = specs.find((spec) => spec.key === key);
      settings[key] = options ? value : Math.min(Math.max(value, low), high);
      const beyond = `${value} is beyond the slider: ${settings[key]}.`;
      ui.refused.textContent = settings[key] === value ? "" : beyond;
      change();
    },
    (text) => (ui.refused.textContent = text),
  );
  ui.looking.open = matchMedia("(min-width: 960px) and (min-height: 601px)").matches;
  main.ariaBusy = false;
  ui.moment.max = last;
  for (const [moment, name] of head.marks) {
    const style = `left: ${(100 * moment) / last}%`;
    const ariaLabel = Number(name) ? `bounce ${name}` : name;
    ui.line.append(element("button", { style, ariaLabel, onclick: () => goTo(moment) }, name));
  }
  ui.options.onchange = () => change();
  ui.fold.onclick = () => {
    ui.fold.ariaExpanded = ui.graphs.classList.toggle("unfolded");
    show();
  };
  window.onbeforeprint = () => {
    const { theme } = settings;
    window.onafterprint = () => change(theme);
    change("light"); // as the paper
  };
  ui.moment.oninput = () => goTo(Number(ui.moment.value));
  ui.moment.onpointerdown = () => (held = [place, isPlaying]);
  ui.moment.onpointercancel = () => {
    goTo(held[0]); // the finger scrolls the page
    setPlaying(held[1]);
  };
  ui.play.onclick = () => setPlaying(!isPlaying);
  new IntersectionObserver(([entry]) => (isVisible = entry.isIntersecting)).observe(document.body); // in a frame
  const resized = new ResizeObserver(arrange);
  for (const one of [ui.disks, ui.graphs]) resized.observe(one);
  setPlaying(!matchMedia("(prefers-reduced-motion: reduce)").matches);
  if (head.again) throws = new Throws(ui, head, panes[0].drawing.scene, takeThrow);
  else take(runs.map((run) => new Recording(run, data, head)));
  change();
  arrange();
  requestAnimationFrame(function next(now) {
    if (isPlaying && isVisible && curves) {
      place += Math.min((now - before) / 1000, 0.1) * fps * settings.speed;
      if (place > last && throws) goTo(last); // where a throw stops
      if (place > last) place = 0;
      show();
    }
    before = now;
    requestAnimationFrame(next);
  });
}

play().catch((error) => {
  document.querySelector("main").ariaBusy = true; // shows the sentence
  document.getElementById("silent").append(` (${error.message})`);
});
