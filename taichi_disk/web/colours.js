// The values at the points that colours show, as fields/__init__.py computes them.

const MIN_AREA = 0.1; // of a triangle over its unloaded area
const SMOOTHING = 0.06; // of fringes [R]
const MAX_PASSES = 12;

export class Colours {
  // triangles, springs: their points; positions, of the unloaded disk; rest: lengths of the springs
  constructor({ triangles, springs, positions, rest, masses, k_a, k_b }) {
    Object.assign(this, { springs, rest, masses, k_a, k_b, corners: triangles });
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
    const place = (c) => [x[2 * corners[c]], x[2 * corners[c] + 1]];
    return Float64Array.from({ length: corners.length / 3 }, (_, t) => {
      const [[ax, ay], [bx, by], [cx, cy]] = [place(3 * t), place(3 * t + 1), place(3 * t + 2)];
      return 0.5 * ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax));
    });
  }

  // Return the number of triangles that are turned inside out.
  folded(x) {
    return this.areas(x).filter((area) => area < 0).length;
  }

  // Return the areas of the triangles, none of them nearly 0.
  safeAreas(x) {
    return this.areas(x).map((area, t) => Math.max(area, this.least[t]));
  }

  // Return the sums at the points of integrals over the triangles around them.
  summed(integrals) {
    const sums = new Float64Array(this.masses.length);
    this.corners.forEach((i, c) => (sums[i] += integrals[(c / 3) | 0]));
    return sums;
  }

  // Return the mean at each point over its springs' ends, and of what it has itself.
  averaged(atEnd, own) {
    const sums = own ? own.slice() : new Float64Array(this.masses.length);
    const counts = new Uint8Array(sums.length).fill(own ? 1 : 0);
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
    const { springs, rest, around, k_a, k_b } = this;
    const parts = [0, 1, 2].map(() => new Float64Array(this.least.length));
    this.sides.forEach((k, c) => {
      const [i, j, s] = [2 * springs[2 * k], 2 * springs[2 * k + 1], this.stretch(x, k)];
      const [dx, dy] = [x[i] - x[j], x[i + 1] - x[j + 1]];
      const weight = (s * (k_a + k_b * s * s)) / ((rest[k] + s) * around[k]);
      parts[0][(c / 3) | 0] += weight * dx * dx;
      parts[1][(c / 3) | 0] += weight * dy * dy;
      parts[2][(c / 3) | 0] += weight * dx * dy;
    });
    const areas = this.summed(this.safeAreas(x));
    return parts.map((part) => this.summed(part).map((sum, i) => sum / areas[i]));
  }

  smoothed(values) {
    const { springs } = this;
    for (let k = 0; k < this.passes; k++)
      values = this.averaged((end) => values[springs[end ^ 1]], values);
    return values;
  }

  // Return a quantity at the points at `x` with velocities `v`.
  of(name, x, v) {
    const shear = ([xx, yy, xy]) => xx.map((one, i) => Math.hypot(0.5 * (one - yy[i]), xy[i]));
    if (name === "shear") return shear(this.stress(x));
    if (name === "fringes")
      return shear(this.stress(x).map((part) => this.smoothed(part))).map((one) => 2 * one);
    if (name === "pressure") {
      const [xx, yy] = this.stress(x);
      return xx.map((one, i) => -0.5 * (one + yy[i]));
    }
    if (name === "rate") {
      const [later, earlier] = [0.5, -0.5].map((part) =>
        this.safeAreas(x.map((one, i) => one + part * v[i])),
      );
      const areas = this.summed(this.safeAreas(x)); // an area is quadratic, so the difference is exact
      return this.summed(later.map((one, t) => one - earlier[t])).map((one, i) => -one / areas[i]);
    }
    if (name === "strain")
      return this.averaged((end) => this.stretch(x, end >> 1) / this.rest[end >> 1]);
    if (name === "force") {
      return this.averaged((end) =>
        ((s) => s * (this.k_a + this.k_b * s * s))(this.stretch(x, end >> 1)),
      );
    }
    const mean = [0, 1].map((axis) =>
      this.masses.reduce((sum, m, i) => sum + m * v[2 * i + axis], 0),
    );
    const speed = this.masses.map((_, i) => Math.hypot(v[2 * i] - mean[0], v[2 * i + 1] - mean[1]));
    return name === "speed" ? speed : speed.map((one, i) => 0.5 * this.masses[i] * one * one);
  }
}
