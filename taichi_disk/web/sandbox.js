// The sandbox's page: shows what the program sends, and sends what the user does. It computes no physics.

import { Choice, Group, Slider, asText, download, element, showHelp, showResults, showScenes } from "./controls.js";
import { Drawing } from "./draw.js";
import { Gestures } from "./gestures.js";
import { Graphs, drawResults, legend } from "./graphs.js";
import { unpacked } from "./message.js";

const KEYS = { " ": "space", ArrowLeft: "Left", ArrowRight: "Right", ArrowUp: "Up", ArrowDown: "Down" };
const REPEATED = "Left Right Up Down e d a z s f i u".split(" ");
const ALL = 9e6; // the number of no state: all are seen
const WATCHED = "Somebody else plays; you are watching.";

export class Sandbox {
  // `root` finds elements by id: the document, or a widget's shadow root; `send` takes a command for the program.
  constructor(node, root, send) {
    Object.assign(this, { node, root, plays: true, hello: null, panel: null, state: null, recorder: null });
    this.send = (message) => {
      if (this.plays || message.do === "seen") send(message);
      if (message.do !== "seen") this.waiting ??= setTimeout(() => (this.find("busy").hidden = false), 400);
    };
    this.drawing = new Drawing(this.find("disk"));
    this.gestures = new Gestures(this.find("disk"), this);
    this.graphs = new Graphs([this.find("energy"), this.find("motion")], (t) => this.send({ do: "scrub", t }));
    const set = (key, value) => this.send(key === "speed" ? { do: "speed", value } : { do: "set", key, value });
    this.groups = Object.entries({ numbers: Slider, speed: Slider, magnify: Slider, choices: Choice, looks: Choice })
      .map(([id, Kind]) => [id, new Group(this.find(id), Kind, set)]);
    this.bind();
    this.showTab(node.clientWidth > 640 ? "graphs" : "experiment"); // on a narrow page one panel is seen at a time
    new ResizeObserver(() => this.redraw()).observe(node);
    // A state may be lost on its way: the program waits for none that is has not come for 2 s.
    setInterval(() => performance.now() - this.arrived > 2000 && this.redraw(ALL), 2000);
  }

  find(id) {
    return this.root.getElementById(id);
  }

  shows(id) {
    return this.find(id).checked;
  }

  bind() {
    const press = (key) => () => this.send({ do: "press", key }), { drawing } = this;
    const look = (act) => () => {
      act();
      this.redraw();
    };
    const zoom = (factor) => look(() => drawing.zoom(factor, ...drawing.middle));
    const here = () => this.state.row;
    this.actions = {
      before: press("b"), after: press("n"), drop: press("space"), start: press("r"), hit: press("h"), lattice: press("l"),
      back: press("Left"), forth: press("Right"), slow: press("y"),
      scenes: () => this.find("list").showModal(), help: () => this.find("keys").showModal(),
      all: look(() => drawing.fit()), closer: zoom(1.25), farther: zoom(0.8),
      contact: look(() => Object.assign(drawing.camera, { x: here().com_x, y: 0.09, scale: drawing.width / 0.55, home: false })),
      follow: look(() => (drawing.follow = this.shows("follow"))),
      forces: look(() => {}), outline: look(() => {}), path: look(() => {}), arrow: look(() => {}),
      rescale: () => this.send({ do: "rescale" }), yaml: () => download(this.scene, "scene.yaml", "text/yaml"),
      collect: () => this.send({ do: "collect" }), clear: () => this.send({ do: "clear" }),
      csv: () => download(asText(this.panel.results, ","), "results.csv", "text/csv"),
      copy: () => navigator.clipboard?.writeText(asText(this.panel.results, "\t")),
      picture: async () => download(await drawing.picture(this.panel.title), "disk.png", "image/png"),
      film: () => this.film(),
      fold: () => this.find("fold").setAttribute("aria-expanded", !this.node.toggleAttribute("data-folded")),
    };
    for (const [id, act] of Object.entries(this.actions)) this.find(id).onclick = () => this.state && act();
    for (const tab of this.node.querySelectorAll(".tabs [data-tab]")) {
      tab.onclick = () => this.showTab(tab.dataset.tab);
    }
    this.root.addEventListener("keydown", (event) => this.key(event));
    for (const one of this.node.querySelectorAll("dialog")) one.onclick = (event) => event.target === one && one.close();
  }

  showTab(name) {
    this.node.dataset.tab = name;
    this.node.removeAttribute("data-folded");
    this.find("fold").setAttribute("aria-expanded", true);
    for (const tab of this.node.querySelectorAll(".tabs [data-tab]")) tab.setAttribute("aria-pressed", tab.dataset.tab === name);
    this.redraw();
  }

  key(event) {
    const { target, ctrlKey, altKey, metaKey } = event, key = KEYS[event.key] ?? event.key;
    if (ctrlKey || altKey || metaKey || !this.state || this.node.querySelector("dialog[open]")) return;
    if (target.matches("input[type=text], select") || (target.matches("input[type=range]") && /^[A-Z]/.test(key))) return;
    if (target.matches("button, input[type=checkbox]") && [" ", "Enter"].includes(event.key)) return;
    const own = { i: "closer", u: "farther", g: "contact", Backspace: "all", p: "picture", v: "film", w: "yaml", "?": "help" };
    if (event.repeat && !REPEATED.includes(key)) return;
    if (key === "Enter") this.find("follow").click();
    else if (own[key]) this.actions[own[key]]();
    else if (this.hello.keys.some(([keys]) => keys.split(" ").includes(key))) this.send({ do: "press", key });
    else return;
    event.preventDefault();
  }

  film() {
    if (this.recorder) return this.recorder.stop();
    const parts = [], recorder = (this.recorder = new MediaRecorder(this.find("disk").captureStream(30)));
    recorder.ondataavailable = ({ data }) => parts.push(data);
    recorder.onstop = () => {
      download(new Blob(parts), `disk.${/mp4/.test(recorder.mimeType) ? "mp4" : "webm"}`, recorder.mimeType);
      this.recorder = null;
      this.showFilm();
    };
    recorder.start();
    this.showFilm();
  }

  showFilm() {
    const film = this.find("film");
    film.textContent = this.recorder ? "End the film" : "Film";
    film.setAttribute("aria-pressed", Boolean(this.recorder));
  }

  // ---- what the program sends

  connected(yes) {
    if (!yes) this.find("role").textContent = "The program does not answer; waiting for it …";
  }

  receive(data) {
    if (typeof data !== "string") return this.showState(data);
    const message = JSON.parse(data), { kind } = message;
    if (kind === "hello") showHelp(this.find("reference"), (this.hello = message).keys);
    else if (kind === "role") this.find("role").textContent = (this.plays = message.plays) ? "" : WATCHED;
    else if (kind === "scene") this.drawing.setScene(message);
    else if (kind === "graphs") this.showGraphs(message);
    else if (kind === "panel") this.showPanel(message);
    else if (kind === "yaml") this.scene = message.text;
  }

  showState(buffer) {
    this.state = unpacked(buffer, this.hello.columns, this.hello.curves.length);
    this.arrived = performance.now();
    this.graphs.add(this.state);
    this.find("caption").textContent = this.state.caption;
    this.waiting = clearTimeout(this.waiting);
    this.find("busy").hidden = true;
    this.redraw(this.state.number);
  }

  // Draw once before the next picture of the screen; only then the program is told that a state was seen.
  redraw(number) {
    this.unseen = number ?? this.unseen;
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      if (this.state && this.drawing.scene) this.draw();
      if (this.unseen) this.send({ do: "seen", number: this.unseen });
      this.unseen = 0;
    });
  }

  draw() {
    const { drawing, state, panel, gestures, graphs } = this, { com_vx, com_vy } = state.row, theme = drawing.scene.themes[this.theme];
    const [v, angle] = panel.aimed ?? [], aimed = panel.aimed && [v * Math.sin(angle), -v * Math.cos(angle)];
    const arrow = aimed ?? (this.shows("arrow") && panel.isImpact ? [com_vx, com_vy] : null);
    drawing.set({ ...this.look, arrow, forces: this.shows("forces"), outline: this.shows("outline"), path: this.shows("path") });
    drawing.draw(state);
    if (state.pulled >= 0 && gestures.target) {
      const ends = [drawing.toScreen(state.x[2 * state.pulled], state.x[2 * state.pulled + 1]), drawing.toScreen(...gestures.target)];
      drawing.drawArrow(...ends, 3, 8, theme.accent, theme.ground);
    }
    graphs.draw(state.t, this.hello.curves, theme);
    if (this.node.dataset.tab === "results") drawResults(this.find("diagram"), panel.results, theme);
  }

  showGraphs(message) {
    const curves = this.hello.curves, [motion, unit] = message.motion;
    this.graphs.replace(message);
    legend(this.find("energies"), [["energies [Mc²]"], ...curves.slice(0, 5).map(([, name, colour]) => [name, colour])]);
    legend(this.find("motions"), [[`${curves[5][1]} [Mc²/R], left`, curves[5][2]], [`${motion} [${unit}], right`, curves[6][2]]]);
  }

  showPanel(panel) {
    const show = (id, text) => (this.find(id).textContent = text), look = (key) => panel.choices.find((one) => one.key === `video.${key}`).value;
    this.panel = panel;
    this.node.ariaBusy = false; // all that was empty until now is filled
    const magnify = panel.sliders.find((one) => one.key === "video.magnify");
    this.theme = this.node.dataset.theme = look("theme");
    this.look = { theme: this.theme, draw: look("draw"), quantity: look("colour"), magnify: magnify.value };
    const speed = panel.sliders.filter((one) => one.key === "speed"), looks = panel.choices.filter((one) => one.key.startsWith("video."));
    const parts = { speed, magnify: [magnify], looks, numbers: panel.sliders.filter((one) => ![magnify, ...speed].includes(one)) };
    parts.choices = panel.choices.filter((one) => !looks.includes(one));
    for (const [id, group] of this.groups) group.show(parts[id]);
    const lines = (tag, texts) => texts.map((text) => element(tag, { textContent: text.replace(/ {4}/g, " · ") }));
    this.find("title").replaceChildren(...lines("div", panel.title));
    this.find("warnings").replaceChildren(...lines("li", panel.warnings));
    show("drop", panel.paused ? (panel.atStart ? (panel.isImpact ? "Drop" : "Load") : "Go on") : "Pause");
    this.find("hit").disabled = !panel.isImpact;
    show("scenes", `${panel.name} ▾`);
    show("sentence", panel.sentence);
    show("solver", `Solver: ${panel.solver}`);
    show("lattice", `Another random lattice (now ${panel.seed})`);
    show("status", panel.status);
    this.find("status").className = panel.status.startsWith("same") ? "" : "disturbed";
    const aimed = panel.aimed && `v = ${panel.aimed[0]} c, angle ${((panel.aimed[1] * 180) / Math.PI).toFixed(1)}° = ${panel.aimed[1]} rad`;
    show("message", aimed || panel.message || panel.hint);
    this.find("slow").checked = panel.slow;
    this.find("slow").disabled = !panel.isImpact;
    const name = panel.isImpact ? "e(v)" : "ξ(P)";
    show("collect", panel.collecting ? `Stop (${panel.collecting} left)` : `Collect ${name}`);
    show("curve", panel.isImpact ? "restitution e over the speed v [c]" : "compression ξ [R] over the load P [Mc²/R]");
    for (const id of ["copy", "csv", "clear"]) this.find(id).disabled = !panel.results.length;
    this.find("tab-results").textContent = `Results${panel.results.length ? ` (${panel.results.length})` : ""}`;
    showResults(this.find("table"), panel.results);
    showScenes(this.find("entries"), this.hello.playlist, panel.number, (number) => {
      this.find("list").close();
      this.send({ do: "play", number });
    });
    this.redraw();
  }
}
