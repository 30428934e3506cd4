// A throw of the film's disk with other numbers. film.js plays it as it plays recorded states.

import { Colours } from "./colours.js";
import { digits } from "./controls.js";
import { decoded } from "./draw.js";
import { FRINGES } from "./legend.js";

const LEAST_FORCE = 0.01; // on a point, over the full one, that has an arrow

// Return where a value lies in one ascending list, at the corresponding place of another.
function mapped(value, from, to) {
  const k = from.slice(1, -1).findLastIndex((one) => one <= value) + 1; // of its interval
  return to[k] + ((value - from[k]) / (from[k + 1] - from[k])) * (to[k + 1] - to[k]);
}

const largest = (list) => list.reduce((most, one) => Math.max(most, Math.abs(one)), 0);
const fixed = (value) => value.toFixed(2).replace("-", "−").replace("−0.00", "0.00");
const signed = (value) => (value >= 0.005 ? `+${fixed(value)}` : fixed(value));

// Return the disk that a film's message describes, with the film's `rules` (see throws.py); `scene`: of
// its drawing.
export function diskOf(message, { springs, triangles, outline }) {
  const positions = decoded(message.positions, Float64Array);
  const masses = decoded(message.masses, Float64Array);
  const distance = (i, j) =>
    Math.sqrt((positions[2 * i] - positions[2 * j]) ** 2 + (positions[2 * i + 1] - positions[2 * j + 1]) ** 2);
  const lengths = new Float64Array(springs.length / 2);
  const rest = lengths.map((_, k) => distance(springs[2 * k], springs[2 * k + 1]));
  const chord = largest([...outline].map((i, k) => distance(i, outline.at(k - 1))));
  const [heaviest, lightest] = [Math.max(...masses), Math.min(...masses)];
  const disk = { ...message, springs, triangles, positions, masses, rest, chord, heaviest, lightest };
  return { ...disk, colours: new Colours(disk) };
}

// Attributes: those of a recording; the `flight`, of stepper.js, and the `duration` of its computation
// [ms]; `folded`: number of triangles turned inside out.
export class Again {
  constructor(disk, film, flight, duration) {
    const { speed: v, etaStar, moments } = flight;
    Object.assign(this, { disk, flight, duration, v, moments, limits: {} });
    // The film begins before t = 0, as high as `disk.top`.
    const early = Math.min((flight.gap - disk.top) / v, -1e-6);
    const [first] = flight.states;
    const x = first.x.map((one, i) => one - (i % 2) * v * early);
    this.states = [{ ...first, t: early, com_y: first.com_y - v * early, x }, ...flight.states];
    this.times = this.states.map(({ t }) => t);
    const [start, , end] = moments;
    this.end = Math.min(end + disk.rules.besideContact * (end - start), flight.rows[flight.end].t);
    this.centre = disk.masses.reduce((sum, m, i) => sum + m * first.x[2 * i], 0);
    // Pictures lie between the moments of the contact as those of the film that was packed.
    const from = [film.times[0], ...disk.moments, film.times.at(-1)];
    const to = [early, ...moments, this.times.at(-1)];
    this.pictures = film.cues.map((k) => mapped(film.times[k], from, to));
    this.cues = this.pictures.map((t) => this.place(t));
    this.fit();
    this.curves = disk.curves.map((curve) => this.measured(curve)).filter(Boolean);
    this.captions = this.words(film);
    const [name, , ...others] = film.runs[0].scene.title;
    const ofThrow = { velocity: `v = ${digits(v)} c`, damping: `η* = ${digits(etaStar)}` };
    this.title = [name, Object.values({ ...disk.numbers, ...ofThrow }).join("    "), ...others];
  }

  // Return the place of a time in the list of states.
  place(t) {
    const { times } = this;
    return t < 0 ? 1 - t / times[0] : Math.min(1 + t / times[2], times.length - 1);
  }

  // Return the round number nearest to a value.
  round(value) {
    const decade = 10 ** Math.floor(Math.log10(Math.max(value, 1e-12)));
    const distance = (step) => Math.abs(Math.log((step * decade) / value));
    const nearer = (one, other) => (distance(other) < distance(one) ? other : one);
    return decade * this.disk.rules.roundNumbers.reduce(nearer);
  }

  at(t) {
    return this.states[Math.round(this.place(t))];
  }

  // Choose what fits the state of the greatest compression.
  fit() {
    const { disk, flight, states, moments } = this;
    const { a, V0, colours, rules } = disk;
    const flattest = this.at(moments[1]);
    const force = a * V0 * Math.exp(-a * flattest.lowest);
    this.edge = Math.max(Math.log((a * V0) / force) / a, 0);
    this.fullForce = this.round(Math.max(force, flight.peakForce / rules.longestForce));
    const flattening = states[1].com_y - states[1].lowest - (flattest.com_y - flattest.lowest);
    const most = this.round(rules.flattening / Math.max(flattening, rules.flattening / rules.mostMagnified));
    this.magnify = disk.magnify === "auto" ? Math.max(most, 1) : disk.magnify;
    this.folded = colours.folded(flattest.x);
    const { vibration, elastic, dissipated } = flight.rows[flight.end];
    const lost = dissipated - flight.rows.find(({ t }) => t >= moments[2]).dissipated;
    const left = vibration + elastic; // half of it is elastic
    const factor = Math.round(rules.ringing * Math.sqrt((2 * flattest.elastic) / left));
    const isShown = factor <= rules.faint && lost <= rules.damped * left;
    this.ringing = isShown ? Math.max(Math.min(factor, rules.mostRinging), 1) : 1;
  }

  // Return a curve with its values, or nothing for an energy that cannot be seen.
  measured([panel, column, name, colours]) {
    const values = this.states.map((one) => one[column] / (panel ? 1 : this.v));
    const isSeen = panel < 2 || largest(values) > this.disk.rules.visibleEnergy * this.states[0].total;
    return isSeen && { panel, run: 0, values, name, colours };
  }

  words({ fps, runs }) {
    const { pictures, flight, v, ringing, moments } = this;
    const { ease, slowPace, muchSlower } = this.disk.rules;
    const paces = pictures.map((t, k) => fps * ((pictures[k + 1] ?? t) - t));
    paces.forEach((pace, k) => (paces[k] = pace || paces[k - 1] || paces.find((one) => one)));
    const slowest = Math.min(...paces);
    const factor = Math.max(...paces) / slowest;
    const slow = factor > muchSlower ? `    slowed ${Math.round(factor)} times` : "";
    const result = `*e = ${flight.restitution.toFixed(3)}`;
    const stronger = ringing > 1 ? `the ringing, shown ${ringing} times stronger` : "";
    const end = pictures.findIndex((t) => t >= moments[2]);
    this.strengths = pictures.map((_, k) => {
      const part = Math.min(Math.max(k - end + 1, 0) / (ease * fps), 1);
      return ringing ** (part * part * (3 - 2 * part));
    });
    const after = `after t = ${this.end.toFixed(1)} R/c`;
    const clock = (t) => (t > this.end ? after : `t = ${fixed(t)} R/c`);
    return pictures.map((t, k) => [
      t < 0 ? "before t = 0" : clock(t),
      k < end ? `+${signed(this.at(t).com_vy / v)} v` : result,
      k < end ? runs[0].captions[k][2] : "",
      `1 s = ${digits(paces[k], 2)} R/c${paces[k] < slowPace * slowest ? slow : ""}`,
      k < end ? "" : stronger,
    ]);
  }

  // Return the end of the colour scale.
  limit(quantity) {
    const [first, last] = this.moments;
    const { scaleStates, fullColour } = this.disk.rules;
    const sizes = Array.from({ length: scaleStates }, (_, k) => {
      const { x, v } = this.at(first + ((last - first) * k) / (scaleStates - 1));
      const values = this.disk.colours.of(quantity, x, v).map(Math.abs).sort();
      return values[Math.floor(fullColour * (values.length - 1))];
    });
    return this.round(Math.max(...sizes) / (quantity === "fringes" ? FRINGES : 1));
  }

  // Return the state at a place in the list of states; between two states it is interpolated.
  state(place, quantity) {
    const { disk, states, centre, fullForce, limits } = this;
    const { a, V0 } = disk;
    const k = Math.floor(place);
    const one = states[k];
    const next = states[Math.min(k + 1, states.length - 1)];
    const mixed = (from, to) => from + (place - k) * (to - from);
    const x = one.x.map((from, i) => mixed(from, next.x[i]));
    const v = one.v.map((from, i) => mixed(from, next.v[i]));
    const y = mixed(one.com_y, next.com_y);
    const force = (i) => a * V0 * Math.exp(-a * x[2 * i + 1]);
    const pushed = [...disk.masses.keys()].filter((i) => force(i) > LEAST_FORCE * fullForce);
    return {
      t: place,
      x,
      values: disk.colours.of(quantity, x, v),
      limit: (limits[quantity] ??= this.limit(quantity)),
      forces: pushed.flatMap((i) => [i, 0, force(i)]),
      fullForce,
      path: [...states.slice(0, k + 1).map((each) => [centre, each.com_y]), [centre, y]],
      row: { com_x: centre, com_y: y },
      velocity: [0, mixed(one.com_vy, next.com_vy) / this.v],
    };
  }
}
