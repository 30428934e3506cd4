// Throws a disk at a rigid wall, in double precision. Start, step, rows, end and results are those of
// `taichi-disk run` with velocity_verlet: see impact.py, stability.py, step_control.py, stepping.py.

const NEGLIGIBLE_FORCE = Math.exp(-45); // of the wall on a point [Mc²/R]
const MODULUS = 1.2; // Young's modulus over k_a, for the estimate of a force
const ROUGHNESS = 1.2; // force on a point over that of a smooth rim
const CONTACT_LEVEL = 0.01; // of the largest force, above which contact lasts
const LIMIT_MARGIN = 0.95; // of the stable step with the measured force
const FORCE_SAFETY = 1.5;
const MAX_CLOSING = 2e-5; // energy imbalance at the end, and ever, over the flight's energy
const MAX_WORST = 1e-4;
const MAX_ATTEMPTS = 8;
const LONGEST_ROW = 0.05; // time between rows [R/c, for k_a = 1]
const PART_TO_WAIT = 0.5; // of the time that a disk needs to leave
const TIME_OF_CONTACT = 8; // [R/c], for the estimate of a time

// Return the throw of a disk with the speed v [c] and the dashpots eta = etaStar/n, and its flight until
// it is as high as `disk.top` [R]. It is repeated with a shorter step if the step was too long. After
// each row yield about how much of it is done, from 0 to 1.
export function* throwing(disk, v, etaStar) {
  let choice = { force: estimatedForce(disk, v), safety: disk.safety, excess: Infinity };
  for (let attempt = 1; ; attempt++) {
    const one = new Throw(disk, v, etaStar, choice);
    const end = 2.2 * (one.gap / v) + TIME_OF_CONTACT;
    yield* one.advance(() => one.end, end + Math.min(disk.top / v, end));
    choice = one.shorterStep();
    if (choice && attempt < MAX_ATTEMPTS) continue;
    const { com_vy, lowest, t } = one.rows.at(-1);
    const until = t + Math.min((disk.top - lowest) / com_vy, t); // as long again at most
    yield* one.advance(() => one.rows.at(-1).t >= until, until);
    return one;
  }
}

// Return the largest force of the wall on one point, as stability.impact_point_force estimates it.
function estimatedForce({ k_a, a, chord, heaviest }, v) {
  const modulus = Math.PI * MODULUS * k_a;
  let depth = v;
  for (let k = 0; k < 50; k++)
    depth = Math.min(v * Math.sqrt(Math.log(4 / Math.min(depth, 1)) / modulus), 1);
  const force = (modulus * depth) / Math.log(4 / depth);
  const peak = (ROUGHNESS * force) / Math.sqrt(2 * Math.PI * (force / modulus + 1 / a));
  return Math.max(Math.min(force, peak * chord), 0.5 * a * heaviest * v ** 2);
}

class Throw {
  steps = 0;
  lost = 0; // in dashpots
  power = 0; // of the dashpots
  peakForce = 0; // of the wall on a point
  wait = 0; // rows until the end is judged again
  end = 0; // number of the last row of the impact; later ones belong to the flight
  rows = [];
  states = []; // rows with positions and velocities, for pictures

  constructor(disk, speed, etaStar, choice) {
    const { positions, masses, springs, a, k_a, rest } = disk;
    Object.assign(this, { disk, speed, etaStar, choice, rest, eta: etaStar / masses.length });
    // The wall's potential over the kinetic energy is that of the disk's own throw.
    this.gap = disk.gap + (2 / a) * Math.log(disk.velocity / speed);
    this.x = positions.map((one, i) => one + (i % 2) * (this.gap - disk.gap));
    this.v = positions.map((_, i) => (i % 2) * -speed);
    this.u = this.v.slice(); // predicted velocities, for the dashpots
    this.f = new Float64Array(positions.length);
    this.inverse = positions.map((_, i) => 1 / masses[i >> 1]);
    this.ends = springs.map((i) => 2 * i);
    this.reach = Math.max(0, Math.log((a * disk.V0) / NEGLIGIBLE_FORCE) / a);
    this.dt = choice.safety * this.stableStep(choice.force);
    const longest = LONGEST_ROW / Math.sqrt(k_a);
    const halvings = Math.ceil(Math.log2((longest * a * speed) / 0.3) - 1e-9);
    const automatic = longest * 0.5 ** Math.min(Math.max(halvings, 0), 8);
    const interval = Math.min(disk.interval === "auto" ? automatic : disk.interval, automatic);
    this.stride = Math.max(1, Math.round(interval / this.dt));
    // Rows for pictures are no closer than a slow throw's.
    this.thinning = Math.max(1, Math.round(longest / interval));
    this.power = this.pull();
    for (let i = 0; i < this.v.length; i++)
      this.v[i] -= 0.5 * this.dt * this.inverse[i] * this.f[i];
    this.observe();
  }

  // Return the largest stable step [R/c] if no force on a point exceeds `force`.
  stableStep(force) {
    const { omega, damping, a, lightest } = this.disk;
    const rate = this.eta * damping;
    return 2 / (rate + Math.sqrt(rate ** 2 + omega ** 2 + (a * force) / lightest));
  }

  // Make steps until `isDone`, which is asked after each row; `until`: the expected time [R/c].
  *advance(isDone, until) {
    while (!isDone() && !this.isLost) {
      for (let k = 0; k < this.stride; k++) this.step();
      this.observe();
      yield Math.min(this.rows.at(-1).t / until, 0.99);
    }
  }

  step() {
    const { x, v, f, u, inverse, dt } = this;
    for (let i = 0; i < x.length; i++) {
      const acceleration = inverse[i] * f[i];
      v[i] += dt * acceleration;
      x[i] += dt * v[i];
      u[i] = v[i] + 0.5 * dt * acceleration;
    }
    const power = this.pull();
    this.lost += (dt * (this.power + 2 * power)) / 3;
    this.power = power;
    this.steps += 1;
  }

  // Set the forces to those of the wall, springs and dashpots; return the power lost in the dashpots.
  pull() {
    const { x, v, u, f, ends, rest, eta, reach } = this;
    const { a, V0, k_a, k_b } = this.disk;
    for (let i = 0; i < x.length; i += 2) {
      f[i] = 0;
      f[i + 1] = x[i + 1] < reach ? a * V0 * Math.exp(-a * x[i + 1]) : 0;
      if (f[i + 1] > this.peakForce) this.peakForce = f[i + 1];
    }
    let elastic = 0;
    let power = 0;
    for (let k = 0; k < rest.length; k++) {
      const i = ends[2 * k];
      const j = ends[2 * k + 1];
      const dx = x[i] - x[j];
      const dy = x[i + 1] - x[j + 1];
      const r = Math.sqrt(dx * dx + dy * dy);
      const s = r - rest[k];
      const s2 = s * s;
      elastic += (0.5 * k_a + 0.25 * k_b * s2) * s2;
      const pull = (k_a + k_b * s2) * (s / r);
      const ux = u[i] - u[j];
      const uy = u[i + 1] - u[j + 1];
      power += ux * (ux + 2 * (v[i] - v[j])) + uy * (uy + 2 * (v[i + 1] - v[j + 1]));
      const fx = pull * dx + eta * ux;
      const fy = pull * dy + eta * uy;
      f[i] -= fx;
      f[i + 1] -= fy;
      f[j] += fx;
      f[j + 1] += fy;
    }
    this.elastic = elastic;
    return (eta * power) / 3;
  }

  // Add a row of what is measured, keep the state, and judge whether the disk has left.
  observe() {
    const { x, v, f, inverse, dt, disk, reach, elastic, lost: dissipated, peakForce, rows } = this;
    const now = new Float32Array(x.length);
    let [com_x, com_y, com_vy, kinetic, moment, wall, lowest] = [0, 0, 0, 0, 0, 0, Infinity];
    for (let i = 0; i < x.length; i += 2) {
      const mass = disk.masses[i >> 1];
      const kick = 0.5 * dt * inverse[i]; // the step's last
      const vx = v[i] + kick * f[i];
      const vy = v[i + 1] + kick * f[i + 1];
      const y = x[i + 1];
      now[i] = vx;
      now[i + 1] = vy;
      kinetic += 0.5 * mass * (vx * vx + vy * vy);
      moment += mass * (x[i] * vy - y * vx);
      com_x += mass * x[i];
      com_y += mass * y;
      com_vy += mass * vy;
      if (y < lowest) lowest = y;
      if (y < reach) wall += disk.V0 * Math.exp(-disk.a * y);
    }
    const spin = (moment - com_x * com_vy) / disk.inertia;
    const row = { t: this.steps * dt, com_y, com_vy, lowest, spin, elastic, wall, dissipated, peakForce };
    row.translation = 0.5 * com_vy ** 2; // nothing moves the centre along the wall
    row.rotation = 0.5 * disk.inertia * spin ** 2;
    row.vibration = kinetic - row.translation - row.rotation;
    row.total = kinetic + elastic + wall + dissipated;
    row.wall_force = disk.a * wall;
    const isPicture = rows.length % this.thinning === 0;
    if (isPicture) this.states.push({ ...row, x: new Float32Array(x), v: now });
    rows.push(row);
    this.isLost = !(Math.abs(row.total - rows[0].total) < 0.1 * rows[0].total);
    if (this.isLost) {
      this.end = rows.length - 1;
      this.peakForce = rows.at(-2).peakForce; // of the last good row
    }
    if (!this.end) this.judge(row);
  }

  judge({ com_y, com_vy, lowest, vibration, elastic, spin }) {
    const { gap, disk } = this;
    const hasTurned = com_vy > 0 && lowest >= gap;
    this.wait = hasTurned ? Math.max(this.wait - 1, 0) : 0;
    if (!hasTurned || this.wait) return;
    const amplitude = Math.sqrt(2 * Math.max(vibration + elastic, 0) * disk.compliance);
    const isFast = Math.abs(spin) * disk.radius > com_vy;
    const bottom = isFast ? Math.min(lowest, com_y - disk.radius) : lowest;
    const remaining = Math.max(gap + Math.min(amplitude, 2 * disk.radius) - bottom, 0) / com_vy;
    if (!remaining) this.end = this.rows.length - 1;
    this.wait = Math.max(1, Math.floor((PART_TO_WAIT * remaining) / (this.stride * this.dt)));
  }

  // Return how to choose a shorter step if this one was too long, or null.
  shorterStep() {
    const { dt, choice, peakForce, disk, rows, speed } = this;
    const isTooLong = dt > Math.max(LIMIT_MARGIN, disk.safety) * this.stableStep(peakForce);
    if (isTooLong) return { ...choice, force: FORCE_SAFETY * peakForce };
    const shorter = (part) => (part * dt) / this.stableStep(choice.force);
    if (this.isLost) return { ...choice, safety: shorter(0.5) };
    const gained = rows.map(({ total }) => Math.abs(total - rows[0].total) / (0.5 * speed ** 2));
    const excess = Math.max(gained.at(-1) / MAX_CLOSING, gained.reduce((most, one) => Math.max(most, one)) / MAX_WORST);
    // If the last step has not halved the excess, the step is not its cause.
    if (excess <= 1 || excess > 0.5 * choice.excess) return null;
    return { ...choice, excess, safety: shorter(Math.max(0.25, 0.9 / Math.sqrt(excess))) };
  }

  // ---- results

  get restitution() {
    const [first, last] = [this.rows[0], this.rows[this.end]];
    return Math.sqrt(last.com_vy ** 2 + 2 * last.wall) / Math.sqrt(this.speed ** 2 + 2 * first.wall);
  }

  // Return the beginning of the contact, the greatest compression, and the end [R/c].
  get moments() {
    const { rows } = this;
    const level = CONTACT_LEVEL * rows.reduce((most, one) => Math.max(most, one.wall_force), 0);
    const height = ({ wall_force }) => Math.log(Math.max(wall_force, 1e-300) / level);
    const crossing = (one, next) =>
      one.t + ((next.t - one.t) * height(one)) / (height(one) - height(next));
    const first = rows.findIndex(({ wall_force }) => wall_force >= level);
    const last = rows.findLastIndex(({ wall_force }) => wall_force >= level);
    const most = rows.slice(first, last + 1).reduce((a, b) => (b.elastic > a.elastic ? b : a));
    return [crossing(rows[first - 1], rows[first]), most.t, crossing(rows[last], rows[last + 1])];
  }
}
