// The sandbox's page: shows what the program sends, and sends what the user does. It computes no physics.

import { Controls, asText, showResults, showScenes } from "./controls.js";
import { Drawing } from "./draw.js";
import { followPointers, grip } from "./gestures.js";
import { Graphs, legend, showDiagram } from "./graphs.js";
import { checked, download, element, elements } from "./html.js";
import { unpacked } from "./message.js";

const KEYS = {
  " ": "space",
  ArrowLeft: "Left",
  ArrowRight: "Right",
  ArrowUp: "Up",
  ArrowDown: "Down",
};
const OWN_KEYS = [
  // keys that a control with the focus uses itself
  ["input[type=text], select", /./],
  ["input[type=range]", /^[A-Z]/],
  ["button, input", /^(space|Enter)$/],
];
const NEWEST = 9e6; // above the number of every state: acknowledges all of them

export class Sandbox {
  // `node` holds the elements of index.html; `send` takes a command for the program.
  constructor(node, send) {
    Object.assign(this, {
      node,
      plays: true,
      hello: null,
      panel: null,
      state: null,
      recorder: null,
      target: null,
    });
    const ui = (this.ui = elements(node));
    this.send = (message) => {
      if (this.plays || message.do === "seen") send(message);
      if (message.do !== "seen") this.waiting ??= setTimeout(() => (ui.busy.hidden = false), 400);
    };
    this.drawing = new Drawing(ui.disk);
    this.graphs = new Graphs([ui.energy, ui.motion], (t) => this.send({ do: "scrub", t }));
    const places = { speed: ui.speed, "video.magnify": ui.magnify };
    const place = (key) => places[key] ?? (key.startsWith("video.") ? ui.looks : ui.numbers);
    const set = (key, value) =>
      this.send(key === "speed" ? { do: "speed", value } : { do: "set", key, value });
    this.controls = new Controls(place, set);
    followPointers(
      ui.disk,
      this.drawing,
      () => this.redraw(),
      (...at) => grip(this, ...at),
    );
    node.onclick = ({ target }) =>
      this.state && this.click(target.closest("button, [type=checkbox]"));
    node.getRootNode().addEventListener("keydown", (event) => this.state && this.key(event));
    const own = [...node.querySelectorAll("[aria-keyshortcuts]")];
    this.shortcuts = own.map((one) => [
      one.getAttribute("aria-keyshortcuts"),
      one.title || one.textContent,
    ]);
    own.forEach((one, k) => (one.title = `${this.shortcuts[k][1]} (${this.shortcuts[k][0]})`));
    this.showTab(node.clientWidth > 900 ? "graphs" : "experiment"); // on a narrow page one panel is seen at a time
    new ResizeObserver(() => this.redraw()).observe(node);
    // A state may be lost on its way: after 2 s without one, acknowledge all, so that the program sends again.
    setInterval(() => performance.now() - this.arrived > 2000 && this.redraw(NEWEST), 2000);
  }

  // ---- what the user does

  get actions() {
    const { drawing, ui, panel, node } = this;
    return {
      all: () => drawing.fit(),
      closer: () => drawing.zoom(1.25),
      farther: () => drawing.zoom(0.8),
      contact: () => drawing.show(this.state.row.com_x, 0.09, 0.55),
      picture: async () => download(await drawing.picture(panel.title), "disk.png", "image/png"),
      film: () => this.film(),
      yaml: () => download(this.scene, "scene.yaml", "text/yaml"),
      csv: () => download(asText(ui.table, ","), "results.csv", "text/csv"),
      copy: () => navigator.clipboard?.writeText(asText(ui.table, "\t")),
      fold: () => (ui.fold.ariaExpanded = !node.toggleAttribute("data-folded")),
    };
  }

  click(one) {
    if (!one) return;
    const { press, command, tab, play } = one.dataset;
    if (press) this.send({ do: "press", key: press });
    if (command) this.send({ do: command });
    if (tab) this.showTab(tab);
    if (play) {
      this.ui.list.togglePopover(false);
      this.send({ do: "play", number: Number(play) });
    }
    this.actions[one.id]?.();
    this.redraw();
  }

  key(event) {
    const { target } = event,
      key = KEYS[event.key] ?? event.key;
    if (event.ctrlKey || event.altKey || event.metaKey || this.node.querySelector(":popover-open"))
      return;
    if (OWN_KEYS.some(([controls, keys]) => target.matches(controls) && keys.test(key))) return;
    if (event.repeat && !this.hello.repeating.includes(key)) return;
    const button = this.node.querySelector(`[aria-keyshortcuts="${CSS.escape(key)}"]`);
    if (button) button.click();
    else if (this.hello.keys.some(([keys]) => keys.split(" ").includes(key)))
      this.send({ do: "press", key });
    else return;
    event.preventDefault();
  }

  showTab(name) {
    this.node.dataset.tab = name;
    this.node.removeAttribute("data-folded");
    this.ui.fold.ariaExpanded = true;
    for (const tab of this.node.querySelectorAll("button[data-tab]"))
      tab.ariaPressed = tab.dataset.tab === name;
    this.redraw();
  }

  // Begin to record what the canvas shows, or save what was recorded.
  film() {
    if (this.recorder) return this.recorder.stop();
    const { disk, film } = this.ui,
      recorder = (this.recorder = new MediaRecorder(disk.captureStream(30)));
    recorder.ondataavailable = ({ data }) => {
      download(data, /mp4/.test(data.type) ? "disk.mp4" : "disk.webm", data.type);
      Object.assign(film, { textContent: "Film", ariaPressed: false });
      this.recorder = null;
    };
    recorder.start();
    Object.assign(film, { textContent: "End the film", ariaPressed: true });
  }

  // ---- what the program sends

  lost() {
    this.ui.role.textContent = "The program does not answer; waiting for it …";
  }

  receive(data) {
    if (typeof data !== "string") return this.showState(data);
    const message = JSON.parse(data),
      { kind } = message;
    if (kind === "hello") this.showKeys((this.hello = message));
    else if (kind === "role") this.showRole(message);
    else if (kind === "scene") this.showScene(message);
    else if (kind === "graphs") this.showGraphs(message);
    else if (kind === "panel") this.showPanel(message);
    else if (kind === "yaml") this.scene = message.text;
  }

  showRole({ plays }) {
    this.plays = plays;
    this.ui.role.textContent = plays ? "" : "Somebody else plays; you are watching.";
  }

  showKeys({ keys }) {
    const row = ([key, what]) => [element("dt", {}, key), element("dd", {}, what)];
    this.ui.reference.replaceChildren(...[...keys, ...this.shortcuts].flatMap(row));
  }

  showScene(message) {
    this.drawing.setScene(message);
    this.ui.curve.textContent = message.labels.curve;
    for (const id of ["hit", "slow", "arrow"]) this.ui[id].disabled = message.unused.includes(id);
  }

  showState(buffer) {
    this.state = unpacked(buffer, this.hello.columns, this.hello.curves.length);
    this.arrived = performance.now();
    this.graphs.add(this.state);
    this.ui.caption.replaceChildren(
      ...this.state.caption.split("\n").map((text) => element("span", {}, text)),
    );
    this.waiting = clearTimeout(this.waiting);
    this.ui.busy.hidden = true;
    this.redraw(this.state.number);
  }

  // Draw once before the next picture of the screen; only then tell the program that a state was
  // seen, also if drawing failed: the program waits for that.
  redraw(number) {
    this.unseen = number ?? this.unseen;
    this.frame ??= requestAnimationFrame(() => {
      this.frame = null;
      try {
        if (this.state && this.panel) this.draw();
      } catch (error) {
        this.fail(error);
      } finally {
        if (this.unseen) this.send({ do: "seen", number: this.unseen });
        this.unseen = 0;
      }
    });
  }

  // Say once that the picture could not be drawn; the rest of the page still works.
  fail(error) {
    if (!this.ui.fault.hidden) return;
    this.ui.fault.textContent = `The picture cannot be drawn: ${error.message}`;
    this.ui.fault.hidden = false;
    console.warn(error);
  }

  draw() {
    const { drawing, state, panel, ui, target } = this,
      { com_vx, com_vy } = state.row;
    const [v, angle] = panel.aimed ?? [],
      velocity = v ? [v * Math.sin(angle), -v * Math.cos(angle)] : [com_vx, com_vy];
    const isShown = v || (ui.arrow.checked && !ui.arrow.disabled);
    drawing.set({ ...checked(ui.options), arrow: isShown && velocity });
    drawing.draw(state);
    const theme = drawing.scene.themes[drawing.options.theme],
      held = 2 * state.pulled;
    if (held >= 0 && target)
      drawing.drawArrow([state.x[held], state.x[held + 1]], target, theme.accent, theme);
    this.graphs.draw(state, theme.accent);
  }

  showGraphs(message) {
    const { curves } = this.hello,
      [motion, unit] = message.motion,
      [, force, colour] = curves[5];
    this.graphs.replace(message, curves);
    legend(this.ui.energies, [
      ["energies [Mc²]"],
      ...curves.slice(0, 5).map(([, name, own]) => [name, own]),
    ]);
    legend(this.ui.motions, [
      [`${force} [Mc²/R], left`, colour],
      [`${motion} [${unit}], right`, curves[6][2]],
    ]);
  }

  showPanel(panel) {
    const { ui, node, drawing } = this,
      { labels } = drawing.scene,
      { aimed, results } = (this.panel = panel);
    const specs = [...panel.sliders, ...panel.choices];
    const value = (name) => specs.find(({ key }) => key === `video.${name}`).value;
    this.controls.show(specs);
    drawing.set({
      theme: value("theme"),
      draw: value("draw"),
      quantity: value("colour"),
      magnify: value("magnify"),
    });
    node.style.colorScheme = value("theme");
    const throwing =
      aimed &&
      `v = ${aimed[0]} c, angle ${((aimed[1] * 180) / Math.PI).toFixed(1)}° = ${aimed[1]} rad`;
    const texts = {
      drop: panel.paused ? (panel.atStart ? labels.drop : "Go on") : "Pause",
      scenes: `${panel.name} ▾`,
      sentence: panel.sentence,
      lattice: `Another random lattice (now ${panel.seed})`,
      status: panel.status,
      message: throwing || panel.message || panel.hint,
      collect: panel.collecting ? `Stop (${panel.collecting} left)` : labels.collect,
      "tab-results": results.length ? `Results (${results.length})` : "Results",
    };
    for (const [id, text] of Object.entries(texts)) ui[id].textContent = text;
    ui.warnings.replaceChildren(...panel.warnings.map((text) => element("li", {}, text)));
    ui.status.className = panel.status.startsWith("same") ? "" : "disturbed";
    ui.slow.checked = panel.slow;
    for (const id of ["copy", "csv", "clear"]) ui[id].disabled = !results.length;
    showResults(ui.table, results);
    showDiagram(ui.diagram, results);
    showScenes(ui.entries, this.hello.playlist, panel.number);
    node.ariaBusy = false; // all that was empty until now is filled
    this.redraw();
  }
}
