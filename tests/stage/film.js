// A film of two runs, and what a user does with it. `film` packs it before the page begins.

const STATES = 4;
const bytesOf = (list, Kind) => new Uint8Array(Kind.from(list).buffer);
const differences = (rows) =>
  rows.flatMap((row, k) => row.map((value, i) => value - (k ? rows[k - 1][i] : 0)));

// Return a run with a number, which squeezes its disk, and its arrays.
function runOf(number) {
  const part = (k) => (number + 1) * [0, 100, 400, -200][k];
  const place = (k, [x, y]) => [part(k) * x - 30 * k, -part(k) * y + 100 * k];
  const moved = [0, 1, 2, 3].map((k) => POINTS.flatMap((point) => place(k, point)));
  const steps = differences(moved);
  const codes = (zero) => differences([0, 1, 2, 3].map((k) => POINTS.map((_, i) => zero + 8 * k * (i - 2))));
  const forces = [5, 0, 0.01, 5, 0.002, 0.02, 6, -0.004, 0.03];
  const limit = { limit: 0.05, unit: 0.06 / 255, zero: 0 };
  const arrays = {
    centres: bytesOf([0, 1.2, 0.1, 1, 0.2, 0.9, 0.3, 1.1], Float32Array),
    velocities: bytesOf([0.01, -0.04, 0.01, -0.03, 0, 0, 0, 0.03], Float32Array),
    forces: bytesOf(forces, Float32Array),
    displacements: bytesOf([0, 8].flatMap((shift) => steps.map((one) => one >> shift)), Uint8Array),
    pressure: bytesOf(codes(127), Uint8Array),
    strain: bytesOf(codes(50), Uint8Array),
    fringes: bytesOf(codes(60), Uint8Array),
  };
  const captions = [0, 1, 2, 3, 4, 5].map((k) => {
    const motion = k === 5 ? "*e = 0.9" : `+v = ${k}`;
    return [`t = ${k} of ${number}`, motion, "", "slow", k === 5 ? "the ringing" : ""];
  });
  const scene = { ...SCENE, full_force: 0.03, title: [`run ${number}`, "N = 7", "η* = 2"] };
  const signed = { ...limit, unit: 0.06 / 127, zero: 127 };
  const limits = { pressure: signed, strain: limit, fringes: limit };
  const strengths = [1, 1, 1, 1, 1, 3 + number];
  const numbers = { strengths, states: STATES, full_speed: number ? 0 : 0.04, unit: 1e-3 };
  return { run: { scene, captions, limits, first: [0, 0, 1, 3, 3], ...numbers }, arrays };
}

async function packFilm() {
  const curve = (run, panel, name, values) => {
    return { run, panel, name, values, colours: [`#${panel}11`, `#${panel}ee`] };
  };
  const head = {
    fps: 10,
    cues: [0, 0, 1, 2, 2, 3],
    marks: [[2, "contact"], [3, "greatest compression"]],
    titles: ["normal velocity [initial]", "wall force [Mc²/R]", "energy [Mc²]"],
    times: [3, 5.1, 7.3, 12],
    end: 10.9,
    unit: "R/c",
    curves: [
      curve(0, 0, "", [-1, -0.6, 0.1, 1.9]),
      curve(0, 1, "", [0, 0.01, 0.03, -1e-6]),
      curve(1, 1, "", [0, 0.01, 0.04, -1e-6]),
      curve(0, 2, "elastic", [0, 2e-4, 6e-4, 1e-4]),
      curve(1, 2, "wall", [0, 1e-5, -3e-4, 0]),
      curve(3, 2, "wall", [0, 1e-5, -3e-4, 0]),
    ],
  };
  let data = new Uint8Array();
  head.runs = [0, 1].map((number) => {
    const { run, arrays } = runOf(number);
    run.arrays = {};
    for (const [name, array] of Object.entries(arrays)) {
      const items = /^(centres|velocities|forces)$/.test(name) ? array.length / 4 : array.length;
      const start = Math.ceil(data.length / 4) * 4;
      run.arrays[name] = [start, items];
      data = Uint8Array.from([...data, ...Array(start - data.length).fill(0), ...array]);
    }
    return run;
  });
  const words = new TextEncoder().encode(JSON.stringify(head) + "   ");
  const text = words.subarray(0, words.length - (words.length % 4));
  const parts = [Uint32Array.of(text.length), text, data];
  const stream = new Blob(parts).stream().pipeThrough(new CompressionStream("deflate"));
  const deflated = new Uint8Array(await new Response(stream).arrayBuffer());
  document.getElementById("states").textContent = packed(deflated);
}
