// What the program would send to the sandbox's page, and what a user does there.

const HELLO = {
  kind: "hello",
  columns: ["com_x", "com_y", "com_vx", "com_vy", "lowest_y"],
  curves: [
    ["energy", "flight", "#111", "#aaa"],
    ["energy", "elastic", "#222", "#bbb"],
    ["force", "force of the wall", "#333", "#ccc"],
    ["motion", "motion", "#444", "#ddd"],
  ],
  playlist: [
    card({ spin: 0.3 }),
    card({ name: "Oblique", angle: 0.4, turn: 0.7, a: 3000, spin: -0.2 }),
    card({ name: "Elastic", group: "Walls", kind: "absorbing_wall", boundary: "pinned", velocity: 0.09 }),
    card({ name: "Dashpots", group: "Walls", kind: "absorbing_wall", boundary: "dashpot" }),
    card({ name: "Load", group: "Loads", kind: "compression", pressure: 0.01, velocity: 0 }),
    card({ name: "Square", group: "Bodies", outline: '<svg><path d="M-1-1h2v2h-2z"/></svg>' }),
    { name: "file", question: "From a folder.", group: "Loads" },
  ],
  keys: [["space", "throw"], ["Left Right", "in time"], ["t", "theme"], ["h", "hit"]],
  repeating: ["Left", "e"],
};
function card(more) {
  const numbers = { velocity: 0.04, angle: 0, spin: 0, turn: 0, pressure: 0, a: 300, boundary: null };
  const words = { name: "Bounce", question: "How high?", group: "", kind: "exponential_wall" };
  return { ...words, ...numbers, ...more };
}
const slider = (key, name, unit, low, high, value, keys = "", live = true) => {
  return { key, name, symbol: name[0], unit, low, high, value, keys, live, meaning: `what ${name} is` };
};
const PANEL = {
  kind: "panel",
  message: "",
  refusals: 0,
  status: "same as taichi-disk run",
  warnings: ["few points"],
  paused: true,
  slow: true,
  aimed: null,
  name: "Bounce",
  question: "How high?",
  answer: "",
  number: 0,
  title: ["Bounce", "N = 7"],
  hint: "",
  atStart: true,
  sliders: [
    slider("impact.velocity", "speed v", "c", 1e-3, 0.1, 0.04, "Up Down"),
    slider("impact.angle", "angle", "rad", -1.5, 1.5, 0.25),
    slider("lattice.points", "points N", "", 100, 5000, 700, "", false),
    slider("material.eta_star", "viscosity η*", "", 0, 100, 2.5, "e d"),
    slider("speed", "speed of time", "R/c per s", 0.05, 5, 1),
    slider("video.magnify", "displacements ×", "", 1, 20, 1),
  ],
  choices: [
    { key: "wall.boundary", name: "boundary", options: ["free", "pinned"], value: "free" },
    { key: "video.colour", name: "colours show", options: ["pressure", "strain", "fringes"], value: "pressure" },
    { key: "video.draw", name: "drawn as", options: ["field", "springs", "both", "points"], value: "both" },
    { key: "video.theme", name: "background", options: ["light", "dark"], value: "light" },
  ],
  seed: 5,
  collecting: 0,
  results: [],
  again: 1,
  loadRange: [1e-3, 0.1],
};
const SPEED = 0.04;
const GRAPHS = {
  kind: "graphs",
  t: [0],
  values: [[8e-4], [0], [0], [-SPEED]],
  motion: ["velocity upwards", "c"],
  flight: "flight",
};
const CONTACT = {
  t: [0, 1.3, 2.6, 4],
  values: [[8e-4, 6e-4, 2e-4, 5e-4], [0, 1e-4, 4e-4, 2e-4], [0, 0.01, 0.03, 0], [-0.04, -0.03, 0.004, 0.031]],
};
const result = (more) => {
  const usual = { result: "e", value: 0.91234, load: 0.04, angle: 0, spin: 0, turn: 0, friction: 0 };
  const own = { wall: "rigid", eta_star: 2.5, a: 300, points: 7, seed: 5 };
  return { ...usual, ...own, contact_time: 3.14159, disturbance: "", ...more };
};
const RESULTS = [
  result(),
  result({ load: 0.01, value: 0.952 }),
  result({ load: 0.08, value: 0.871, angle: 0.3 }),
  result({ load: 0.02, value: 0.934, disturbance: "pulled, hit" }),
  result({ load: 0.09, value: 0.825 }),
  result({ load: 0.5, value: 0.2 }),
  result({ load: 1e-4, value: 0.99 }),
  result({ load: 0.03, value: -0.1, a: null }),
];

// Return the binary message of a state; `squeeze` flattens the disk, `turn` turns it.
function stateOf(more) {
  const usual = { t: 0, pulled: -1, centre: [0.2, 1.1], velocity: [0.01, -0.04], squeeze: 1, turn: 0 };
  const rest = { forces: [], values: null, graph: [8e-4, 0, 0, -SPEED], wall: [] };
  const state = { ...usual, ...rest, caption: "t = 0\nlow", ...more };
  const { number, t, pulled, centre, velocity, squeeze, turn, forces, values, graph, wall, caption } = state;
  const cos = Math.cos(turn);
  const sin = Math.sin(turn);
  const place = ([x, y]) => [centre[0] + cos * x - sin * y, centre[1] + squeeze * (sin * x + cos * y)];
  const x = [...POINTS.map(place).flat(), ...wall];
  const colours = values ?? x.slice(0, x.length / 2).map((value, k) => 0.01 * (k - 3));
  const row = [...centre, ...velocity, centre[1] - 0.9];
  const words = new TextEncoder().encode(caption);
  const head = [number, t, x.length / 2, forces.length / 3, pulled, colours.length, 0.05, 0.02];
  const floats = Float32Array.from([...head, ...row, ...graph, ...x, ...colours, ...forces]);
  return Uint8Array.from([...new Uint8Array(floats.buffer), ...words]).buffer;
}

let panel = PANEL;
const hear = (data) => stage.sockets.at(-1).onmessage({ data });
const tell = (message) => hear(JSON.stringify(message));
const show = (more) => tell((panel = { ...panel, ...more }));
const showState = (more) => hear(stateOf(more));
const withValue = (key, value) => ({
  sliders: panel.sliders.map((one) => (one.key === key ? { ...one, value } : one)),
  choices: panel.choices.map((one) => (one.key === key ? { ...one, value } : one)),
});
const key = (name, more = {}) => {
  const event = new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true, ...more });
  (more.target ?? document.body).dispatchEvent(event);
  if (event.defaultPrevented) remark("the key is used");
};
const lead = (name, part) => {
  const one = field(name, "range");
  one.value = Number(one.min) + part * (one.max - one.min);
  one.dispatchEvent(new Event("input", { bubbles: true }));
  remark("let go");
  one.dispatchEvent(new Event("change"));
};
noteFields(Field);

function record() {
  const squeezed = {
    number: 3,
    t: 2.6,
    centre: [0.2, 0.7],
    velocity: [0.02, 0.004],
    squeeze: 0.8,
    turn: 0.2,
    forces: [5, 1e-3, 0.015, 6, 2e-4, 2e-4, 0, -0.01, 0.02],
    graph: [2e-4, 4e-4, 0.03, 0.004],
  };
  step("the page opens, and space is pressed", () => {
    stage.sockets[0].onopen();
    key(" ");
  });
  look("the program begins", () => {
    tell(HELLO);
    tell(SCENE);
    tell(GRAPHS);
    show();
    tell({ kind: "yaml", text: "scene: exponential_wall" });
    showState({ number: 1, turn: 0.2 });
  });
  step("aimed", () => show({ aimed: [0.06, 0.35] }));
  step("thrown", () => {
    show({ aimed: null, paused: false, atStart: false });
    showState({ number: 2, t: 1.3, centre: [0.22, 0.9], graph: [6e-4, 1e-4, 0.01, -0.03] });
  });
  step("in contact, with all options", () => {
    for (const id of ["outline", "path"]) get(id).checked = true;
    show(withValue("video.magnify", 3));
    showState(squeezed);
  });
  step("nothing comes for five seconds", () => wait(5000));
  look("followed, springs", () => {
    get("follow").click();
    show(withValue("video.draw", "springs"));
    show(withValue("video.colour", "strain"));
    showState({ ...squeezed, number: 4, values: Array.from({ length: 12 }, (_, k) => 0.004 * k) });
  });
  step("points and fringes, neither arrows nor paths", () => {
    for (const id of ["follow", "forces", "arrow", "path", "outline"]) get(id).checked = false;
    show(withValue("video.draw", "points"));
    show(withValue("video.magnify", 1));
    show(withValue("video.colour", "fringes"));
    showState({ ...squeezed, number: 5 });
  });
  step("the projector", () => {
    size("disk", 1300, 760);
    key("f");
  });
  step("its user rests", () => wait(3500));
  step("and moves", () => pointer(stage.root, "pointermove", 1, 1));
  step("a narrow page", () => {
    key("Escape");
    size("disk", 470, 390);
    window.devicePixelRatio = 1.5;
    resize();
  });
  step("a narrower one, dark", () => {
    size("disk", 300, 500);
    window.devicePixelRatio = 1;
    show(withValue("video.theme", "dark"));
    show(withValue("video.colour", "strain"));
    resize();
  });
  step("printed", () => window.dispatchEvent(new Event("beforeprint")));
  step("on the screen again", () => window.dispatchEvent(new Event("afterprint")));
  step("an elastic wall, and a load", () => {
    size("disk", 640, 480);
    get("forces").checked = get("arrow").checked = true;
    tell({
      ...SCENE,
      points: 10,
      rest: packed(Float32Array.from([...REST, -2, 0, 0, -0.2, 2, 0])),
      wall: { kind: "elastic", edge: 0.03, decay: 0.02 },
      wall_surface: indices([7, 8, 9]),
      spoke: -1,
      labels: { drop: "Load", collect: "Collect ξ(P)", curve: "ξ over P", unused: "hit slow arrow" },
    });
    tell({ ...GRAPHS, motion: ["compression ξ", "R"], flight: "motion" });
    show({ atStart: true, number: 3, status: "disturbed", warnings: [], seed: 6, loadRange: [1e-4, 0.05] });
    showState({ number: 6, wall: [-2, 0, 0, -0.2, 2, 0], forces: [8, 0, -0.01] });
  });
  step("a rigid wall again", () => {
    tell(SCENE);
    show({ number: 0 });
    showState({ number: 7, velocity: [0, 0] });
  });

  step("the end of a throw", () => {
    tell(SCENE);
    tell({ ...GRAPHS, ...CONTACT });
    show({ atStart: false, paused: true, number: 0, answer: "Not so high.", results: RESULTS.slice(0, 7), loadRange: [1e-3, 0.1], status: PANEL.status });
    showState({ number: 8, t: 4, caption: "t = 4\n*e = 0.912", velocity: [0.01, 0.031] });
  });
  step("the next throw", () => {
    tell(GRAPHS);
    show({ atStart: true, results: RESULTS });
    showState({ number: 9 });
  });
  step("energies below zero, of a spin", () => {
    const values = [[8e-4, 6e-4, 5e-4], [0, -2e-4, -1e-4], [0, 1e-5, 2e-5], [0, 0, 0]];
    tell({ ...GRAPHS, t: [0, 3, 5.5], values });
    show({ atStart: false });
    showState({ number: 10, t: 5.5, graph: [5e-4, -1e-4, 2e-5, 0] });
    showState({ number: 11, t: 7, graph: [6e-4, -5e-4, 0.05, 0.01] });
  });
  look("the results with eq. (5)", () => {
    get("eq5").click();
    get("tab-results").click();
  });
  step("computed again", () => show({ again: 0.4 }));
  step("and done, while a curve is collected", () => show({ again: 1, collecting: 3 }));

  step("a message", () => show({ message: "too fast" }));
  step("goes", () => wait(6500));
  step("a film is made", () => get("film-page").click());
  step("and comes", () => tell({ kind: "film", page: "<html>" }));
  step("another cannot be made", () => {
    get("film-page").click();
    tell({ kind: "film", page: "" });
  });
  step("all is saved", () => ["picture", "yaml", "csv"].forEach((id) => get(id).click()));
  step("the program is slow", () => {
    get("start").click();
    wait(500);
  });
  step("and answers", () => showState({ number: 12 }));

  step("typed", () => {
    type("impact.velocity", "1/50");
    type("impact.angle", "45°", 1);
    type("impact.angle", "2%");
    type("impact.angle", "-2");
  });
  step("the right number is taken", () => show({ message: "", ...withValue("impact.angle", -2) }));
  step("a number is refused twice", () => {
    for (const refusals of [1, 2]) {
      show({ refusals, message: "too fast" });
      remark(get("message").textContent);
      sandbox.say("");
    }
  });
  step("led", () => {
    lead("impact.velocity", 0.5);
    lead("lattice.points", 0.9);
    lead("material.eta_star", 0.3);
  });
  step("chosen", () => {
    const select = document.querySelector('[data-key="video.theme"] select');
    select.value = "dark";
    select.onchange();
  });
  step("the system is dark, until a theme is chosen", () => {
    const system = media["(prefers-color-scheme: dark)"];
    system.matches = true;
    system.onchange();
    key("t");
    system.onchange();
  });
  step("copied, with and without a clipboard", () => {
    let clipboard = { writeText: async (text) => note(`  clipboard ${text}`) };
    Object.defineProperty(navigator, "clipboard", { get: () => clipboard });
    document.execCommand = (name) => note(`  ${name} ${document.activeElement.value}`);
    for (const one of [clipboard, undefined]) {
      clipboard = one;
      get("copy").click();
    }
  });
  step("keys", () => {
    for (const name of [" ", "ArrowLeft", "t", "g", "é", "?"]) key(name);
    get("keys").close();
    for (const [name, code] of [["T", "KeyT"], ["т", "KeyT"], ["τ", "KeyT"], ["t", "KeyK"]])
      key(name, { code });
    key("h", { repeat: true });
    key("ArrowLeft", { repeat: true });
    key("h", { ctrlKey: true });
    key("h", { target: field("impact.velocity", "text") });
    key("ArrowLeft", { target: field("impact.velocity", "range") });
    key("H", { target: field("impact.velocity", "range") });
    key(" ", { target: get("drop") });
  });
  step("buttons", () => {
    for (const id of ["closer", "farther", "contact", "all", "fold", "scenes", "film-page"]) get(id).click();
    document.querySelector("#entries [data-play='2']").click();
    document.querySelector("[data-remove='1']")?.click();
    get("timeline").value = 0.5;
    get("timeline").oninput();
  });
  step("a press beside a dialog closes it", () => {
    get("help").click();
    const box = get("keys").getBoundingClientRect();
    const press = (clientX, clientY) =>
      get("keys").dispatchEvent(new PointerEvent("pointerdown", { clientX, clientY }));
    for (const [x, y] of [[1, 1], [box.width - 1, box.height - 1], [1, box.height + 1]]) {
      press(box.left + x, box.top + y);
      remark(`open: ${get("keys").open}`);
      get("keys").open || get("keys").showModal();
    }
    get("keys").close();
  });

  step("a graph is dragged", () => {
    drag("energy", [120, 20], [500, 30]);
    drag("motion", [40, 20], [-3, 30], { buttons: 2 });
  });
  step("the picture is moved and zoomed", () => {
    drag("disk", [300, 200], [340, 225], { button: 2 });
    drag("disk", [300, 200], [290, 190], { shiftKey: true });
    const wheel = new WheelEvent("wheel", { deltaY: -90, cancelable: true });
    Object.defineProperties(wheel, { offsetX: { value: 100 }, offsetY: { value: 120 } });
    get("disk").dispatchEvent(wheel);
  });
  const at = (x, y) => sandbox.drawing.toScreen(x, y);
  step("two fingers", () => {
    pointer(get("disk"), "pointerdown", 200, 200, { button: 2 });
    pointer(get("disk"), "pointerdown", 300, 200, { pointerId: 2 });
    pointer(get("disk"), "pointermove", 320, 240, { pointerId: 2 });
    pointer(get("disk"), "pointerup", 320, 240, { pointerId: 2 });
    pointer(get("disk"), "pointerup", 200, 200);
    remark(`two points are at ${pairs([at(0, 0), at(1, 1)])}`);
  });
  look("a point is pulled", () => {
    get("contact").click();
    remark(`after the contact was at ${pairs([at(0, 0), at(1, 1)])}`);
    get("all").click();
    pointer(get("disk"), "pointerdown", ...at(0.2, 0.2));
    showState({ number: 13, pulled: 6 });
  });
  step("and let go", () => {
    pointer(get("disk"), "pointermove", ...at(0.4, 0.3));
    pointer(get("disk"), "pointerup", ...at(0.4, 0.3));
  });
  look("the throw is aimed at the arrow's tip, and from beside the disk", () => {
    show({ atStart: true });
    showState({ number: 14 });
    drawFrame();
    const length = arrowLength(Math.hypot(0.01, 0.04)) / Math.hypot(0.01, 0.04);
    const tip = at(0.2 + 0.01 * length, 1.1 - 0.04 * length);
    drag("disk", [tip[0] + 20, tip[1]], at(0.5, 0.5));
    drag("disk", [tip[0] + 27, tip[1]], at(0.5, 0.5));
    drag("disk", at(1.4, 1.1), at(1.7, 0.9));
    drag("disk", at(1.4, 1.1), at(1.4, 1.1), { cancelled: true });
  });
  step("the disk is turned", () => {
    drag("disk", at(0.7, 1.1), at(0.6, 1.6));
    drag("disk", at(0.7, 1.1), at(0.6, 1.6), { cancelled: true });
  });
  look("a body is drawn anew, over its start, and refused where it crosses itself", () => {
    get("draw").click();
    drag("disk", at(1, 1), at(2, 2), { cancelled: true });
    pointer(get("disk"), "pointerdown", ...at(1, 1));
    for (let k = 1; k < 20; k++)
      pointer(get("disk"), "pointermove", ...at(Math.cos(0.35 * k), 1 + Math.sin(0.35 * k)));
    drawFrame();
    pointer(get("disk"), "pointerup", ...at(1, 1));
    show({ message: "lattice.outline: /tmp/drawn-1.svg: it crosses itself at (0.5, 1.5): no", refusals: 3 });
    note(`  ${get("message").textContent}`);
  });
  step("the next one is a body, whose outline is saved", () => {
    tell({ kind: "yaml", text: "scene: exponential_wall", outline: "<svg/>", name: "outline.svg" });
    get("svg").click();
    get("draw").click();
    drag("disk", at(0.7, 1.1), at(0.7, 1.1));
  });

  step("the picture fails", () => {
    get("disk").pen.drawImage = () => {
      throw new Error("no colours");
    };
    sandbox.redraw();
  });
  step("nothing is heard for long", () => wait(16000));
  step("the socket is opened again", () => {
    wait(9000);
    stage.sockets.at(-1).onopen();
    stage.sockets.at(-1).onclose();
  });
  step("and again", () => wait(6000));
  const round = [roundBelow(0.3 - 0.1), roundAbove(0.3 - 0.1), roundBelow(0.1 + 0.2), roundAbove(0.1 + 0.2)];
  note(`round numbers: ${round.map(rounded)}`);
  note(`another page of the tab is ${new Sandbox(stage.root, () => {}).theme}`);
}

stage.root = document.querySelector(".sandbox");
stage.shown = described(stage.root);
record();
window.recorded = stage.lines.join("\n");
