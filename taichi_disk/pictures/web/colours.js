// The values at the points that colours show, as fields/__init__.py computes them.

const MIN_AREA = 0.1; // of a triangle over its unloaded area
const SMOOTHING = 0.06; // of fringes [R]
const MAX_PASSES = 12;

export class Colours {
  // triangles, springs: their points; positions, of the unloaded disk; rest: lengths of the springs
  constructor({ triangles, springs, positions, rest, masses, k_a, k_b }) {
    Object.assign(this, { springs, rest, masses, corners: triangles });
    this.pull = (s) => s * (k_a + k_b * s * s);
    const key = (i, j) => Math.min(i, j) * masses.length + Math.max(i, j);
    const known = new Map(Array.from(rest, (_, k) => [key(springs[2 * k], springs[2 * k + 1]), k]));
    const after = (c) => (c % 3 === 2 ? c - 2 : c + 1);
    this.sides = triangles.map((i, c) => known.get(key(i, triangles[after(c)])));
    this.around = new Uint8Array(rest.length); // triangles around a spring
    for (const k of this.sides) this.around[k] += 1;
    this.least = this.areas(positions).map((area) => MIN_AREA * area);
    const spacing = rest.slice().sort()[rest.length >> 1];
    const passes = Math.round((7 / 3) * (SMOOTHING / spacing) ** 2);
    this.passes = Math.min(Math.max(passes, 1), MAX_PASSES);
  }

  areas(x) {
    const { corners } = this;
    const along = (from, to, axis) => x[2 * corners[to] + axis] - x[2 * corners[from] + axis];
    const cross = (a, b, c) => along(a, b, 0) * along(a, c, 1) - along(a, b, 1) * along(a, c, 0);
    return new Float64Array(corners.length / 3).map((_, t) => 0.5 * cross(3 * t, 3 * t + 1, 3 * t + 2));
  }

  // Return the number of triangles that are turned inside out.
  folded(x) {
    return this.areas(x).filter((area) => area < 0).length;
  }

  // Return the sums at the points of integrals over the triangles around them.
  summed(integrals) {
    const sums = new Float64Array(this.masses.length);
    this.corners.forEach((i, c) => (sums[i] += integrals[(c / 3) | 0]));
    return sums;
  }

  // Return integrals at the points over the areas around them, of which none is nearly 0.
  overAreas(x, ...integrals) {
    const areas = this.summed(this.areas(x).map((area, t) => Math.max(area, this.least[t])));
    return integrals.map((one) => this.summed(one).map((sum, i) => sum / areas[i]));
  }

  // Return the mean at each point over its springs' ends, and of what it has itself.
  averaged(atEnd, own = []) {
    const sums = Float64Array.from(this.masses, (_, i) => own[i] ?? 0);
    const counts = new Uint8Array(sums.length).fill(Math.sign(own.length));
    this.springs.forEach((i, end) => {
      sums[i] += atEnd(end);
      counts[i] += 1;
    });
    return sums.map((sum, i) => sum / counts[i]);
  }

  stretch(x, k) {
    const [i, j] = [2 * this.springs[2 * k], 2 * this.springs[2 * k + 1]];
    return Math.sqrt((x[i] - x[j]) ** 2 + (x[i + 1] - x[j + 1]) ** 2) - this.rest[k];
  }

  // Return xx, yy and xy of the stress at the points.
  stress(x) {
    const { springs, rest, around } = this;
    const parts = [0, 1, 2].map(() => new Float64Array(this.least.length));
    this.sides.forEach((k, c) => {
      const [i, j, s] = [2 * springs[2 * k], 2 * springs[2 * k + 1], this.stretch(x, k)];
      const [dx, dy] = [x[i] - x[j], x[i + 1] - x[j + 1]];
      const weight = this.pull(s) / ((rest[k] + s) * around[k]);
      parts[0][(c / 3) | 0] += weight * dx * dx;
      parts[1][(c / 3) | 0] += weight * dy * dy;
      parts[2][(c / 3) | 0] += weight * dx * dy;
    });
    return this.overAreas(x, ...parts);
  }

  // Return twice the largest shear of the smoothed stress.
  fringes(x) {
    const neighbour = (values) => (end) => values[this.springs[end ^ 1]];
    const smoothed = (values) => {
      for (let k = 0; k < this.passes; k++) values = this.averaged(neighbour(values), values);
      return values;
    };
    return shear(this.stress(x).map(smoothed)).map((one) => 2 * one);
  }

  // Return how fast the area around the points shrinks; an area is quadratic, so the difference is exact.
  rate(x, v) {
    const moved = (part) => this.areas(x.map((one, i) => one + part * v[i]));
    const [later, earlier] = [moved(0.5), moved(-0.5)];
    return this.overAreas(x, earlier.map((one, t) => one - later[t]))[0];
  }

  speed(v) {
    const { masses } = this;
    const mean = [0, 1].map((axis) => masses.reduce((sum, m, i) => sum + m * v[2 * i + axis], 0));
    return masses.map((_, i) => Math.hypot(v[2 * i] - mean[0], v[2 * i + 1] - mean[1]));
  }

  // Return a quantity at the points at `x` with velocities `v`.
  of(name, x, v) {
    const { masses, rest } = this;
    const stretched = (value) => this.averaged((end) => value(this.stretch(x, end >> 1), end >> 1));
    const pressure = ([xx, yy]) => xx.map((one, i) => -0.5 * (one + yy[i]));
    const quantities = {
      shear: () => shear(this.stress(x)),
      fringes: () => this.fringes(x),
      pressure: () => pressure(this.stress(x)),
      rate: () => this.rate(x, v),
      strain: () => stretched((s, k) => s / rest[k]),
      force: () => stretched(this.pull),
      speed: () => this.speed(v),
      kinetic: () => this.speed(v).map((one, i) => 0.5 * masses[i] * one * one),
    };
    return quantities[name]();
  }
}

const shear = ([xx, yy, xy]) => xx.map((one, i) => Math.hypot(0.5 * (one - yy[i]), xy[i]));
