// The sandbox's page: shows what the program sends, and sends what the user does. It computes no
// physics.

import { Controls } from "./controls.js";
import { Drawing } from "./draw.js";
import { followPointers, grip } from "./gestures.js";
import { Graphs, LETTERS } from "./graphs.js";
import { checked, copy, download, element, elements, inks, store } from "./html.js";
import { unpacked } from "./message.js";
import { COPIED, asText, showDiagram, showResults } from "./results.js";
import { showScenes } from "./scenes.js";

const OWN_KEYS = [
  // keys that a control with the focus uses itself
  ["input[type=text], select", /./],
  ["input[type=range]", /^[A-Z]/],
  ["button, input[type=checkbox]", /^(space|Enter)$/],
];
const NEWEST = 9e6; // above the number of every state: acknowledges all of them
const MESSAGE_TIME = 6000; // for which a message is shown [ms]
const LEGEND_WIDTH = 280; // that its longest name needs [px]
const READABLE_HEIGHT = 380; // of a picture below which letters must not take more room [px]
const IDLE_TIME = 3000; // after which the projector's controls fade [ms]
const LARGE_HEIGHT = 540; // of a picture, over the factor of its letters [px]
const LEGEND_ROW = 720; // width that the legend's row needs [px]
const LETTER_PART = 0.009; // least size of letters in a page's height
const THEME = "taichi-disk theme"; // name under which the visitor's theme is stored
const DARK = matchMedia("(prefers-color-scheme: dark)");

// Return the program's name of a key. Letters count by their place on the keyboard if the layout
// has others, such as Cyrillic or Greek.
function keyName(event) {
  if (event.key === " ") return "space";
  const isLatin = /^[ -~]*$/.test(event.key);
  const name = isLatin ? event.key : event.code.replace(/^Key/, "");
  return name.length === 1 ? name.toLowerCase() : name.replace(/^Arrow/, "");
}

// Return a line of the read-out; a line that begins with * is the result.
function captionLine(text) {
  return text[0] === "*" ? element("b", {}, text.slice(1)) : element("span", {}, text);
}

// Return whether a dialog was pressed beside its box, on its backdrop.
function isOutside({ target, clientX, clientY }) {
  const { left, right, top, bottom } = target.getBoundingClientRect();
  const isInside = clientX >= left && clientX <= right && clientY >= top && clientY <= bottom;
  return target.matches("dialog") && !isInside;
}

export class Sandbox {
  // `node` holds the elements of index.html; `send` takes a command for the program.
  constructor(node, send) {
    this.node = node;
    this.theme = store[THEME];
    node.dataset.theme = this.theme || (DARK.matches ? "dark" : "light");
    const ui = (this.ui = elements(node));
    this.send = (message) => {
      if (message.key === "space" && this.panel?.paused && this.hasLeft) send({ do: "press", key: "r" });
      send(message);
      if (message.do !== "seen" && message.do !== "film")
        this.waiting ??= setTimeout(() => (ui.busy.hidden = false), 400);
    };
    this.drawing = new Drawing(ui.disk);
    this.stroke = []; // places [R] of the outline that is being drawn
    this.graphs = new Graphs([ui.energy, ui.motion], (t) => this.send({ do: "scrub", t }));
    this.controls = new Controls(
      (key) => node.querySelector(`[data-keys~="${key}"]`) ?? ui.others,
      (key, value) => this.set(key, value),
      (text) => this.say(text),
    );
    const gripped = (...at) => grip(this, ...at);
    followPointers(ui.disk, this.drawing, () => this.redraw(), gripped);
    node.onclick = ({ target }) =>
      this.panel ? this.click(target.closest("button, [type=checkbox]")) : this.expect(target === ui.drop);
    for (const dialog of node.querySelectorAll("dialog"))
      dialog.onpointerdown = (event) => isOutside(event) && dialog.close();
    const press = (event) => (this.panel ? this.key(event) : this.expect(event.key === " "));
    document.addEventListener("keydown", press);
    this.shortcuts = [];
    for (const one of node.querySelectorAll("[aria-keyshortcuts]")) {
      const shortcut = [one.getAttribute("aria-keyshortcuts"), one.title || one.textContent];
      this.shortcuts.push(shortcut);
      one.title = `${shortcut[1]} (${shortcut[0]})`;
    }
    // Where there is a tab for the experiment, one panel is seen at a time.
    this.showTab(node.querySelector(".narrow").clientWidth ? "experiment" : "graphs");
    // On a short phone the disk would be small above the panel.
    if (node.clientWidth <= 640 && node.clientHeight > 480 && node.clientHeight < 740) this.fold();
    new ResizeObserver(() => this.redraw()).observe(node);
    ui.eq5.onchange = () => this.showResults();
    ui.timeline.oninput = () => this.send({ do: "scrub", t: Number(ui.timeline.value) });
    node.onpointermove = () => this.wake();
    DARK.onchange = () => this.takeTheme();
    window.addEventListener("beforeprint", () => this.panel && this.print());
    window.addEventListener("afterprint", () => this.panel && this.showPanel(this.panel));
    document.addEventListener("fullscreenchange", () => {
      if (!document.fullscreenElement) this.project(false);
    });
    // A state may be lost on its way: after 2 s without one, acknowledge all, so that the program
    // sends again.
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
      yaml: () => download(this.scene, "scene.yaml", "text/yaml"),
      svg: () => download(this.outline, this.outlineName, "text/plain"),
      draw: () => this.sketch(!this.isSketching),
      csv: () => download(asText(ui.table, ","), "results.csv", "text/csv"),
      copy: () => copy(asText(ui.table, "\t"), (text) => this.say(text), COPIED),
      projector: () => this.project(!node.hasAttribute("data-projector")),
      fold: () => this.fold(),
      more: () => (ui.more.ariaExpanded = node.toggleAttribute("data-more")),
    };
  }

  // Let the next stroke on the canvas be the outline of a body, or no longer.
  sketch(isOn) {
    this.isSketching = isOn;
    this.stroke = [];
    this.crossing = null;
    this.ui.draw.ariaPressed = isOn;
    if (isOn) this.say("Draw the outline of a body in one stroke: it closes itself.");
  }

  // Remember that the first picture shall be thrown at once.
  expect(isThrow) {
    if (!isThrow || this.isExpected) return;
    this.isExpected = true;
    this.ui.busy.textContent += " then it is thrown";
  }

  click(one) {
    if (!one) return;
    const { press, command, tab, play, remove, opens, closes } = one.dataset;
    if (opens) this.ui[opens].showModal();
    if (closes) this.ui[closes].close();
    if (press) this.send({ do: "press", key: press });
    if (command) this.send({ do: command });
    if (command === "film") this.showFilm(true);
    if (tab) this.showTab(tab);
    if (remove) this.send({ do: "remove", number: Number(remove) });
    if (play) {
      this.ui.list.close();
      this.send({ do: "play", number: Number(play) });
    }
    if (play || one.id === "start") this.ui.drop.focus({ focusVisible: false }); // so that space throws
    this.actions[one.id]?.();
    this.redraw();
  }

  key(event) {
    const { target } = event;
    const key = keyName(event);
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    if (this.node.querySelector("dialog[open]")) return;
    if (OWN_KEYS.some(([controls, keys]) => target.matches(controls) && keys.test(key))) return;
    if (event.repeat && !this.hello.repeating.includes(key)) return;
    if (key === "Escape") this.project(false);
    if (key === "t") this.chooseTheme(this.drawing.options.theme === "dark" ? "light" : "dark");
    const button = this.node.querySelector(`[aria-keyshortcuts="${CSS.escape(key)}"]`);
    if (button) button.click();
    else if (this.hello.keys.some(([keys]) => keys.split(" ").includes(key)))
      this.send({ do: "press", key });
    else return;
    event.preventDefault();
  }

  set(key, value) {
    if (key === "video.theme") this.chooseTheme(value);
    this.shownMessage = null; // this number takes away what was said about another
    this.send({ do: "set", key, value });
  }

  chooseTheme(theme) {
    this.theme = theme;
    store[THEME] = theme;
  }

  // Take the theme that the visitor has chosen, or the system's until then.
  takeTheme() {
    const system = DARK.matches ? "dark" : "light";
    this.send({ do: "set", key: "video.theme", value: this.theme || system });
  }

  // Show only the picture and its curves, with large letters and controls that fade.
  project(isOn) {
    const { node, drawing } = this;
    if (isOn === node.hasAttribute("data-projector")) return;
    node.toggleAttribute("data-projector", isOn);
    this.ui.projector.ariaPressed = isOn;
    drawing.camera.home = true; // it fits again as soon as its size has changed
    if (isOn) {
      this.showTab("graphs");
      node.requestFullscreen?.().catch(() => {}); // a frame may forbid it
    } else if (document.fullscreenElement) document.exitFullscreen();
    this.wake();
    this.redraw();
  }

  // Show the projector's controls for a while.
  wake() {
    this.node.removeAttribute("data-idle");
    clearTimeout(this.idle);
    this.idle = setTimeout(() => this.node.setAttribute("data-idle", ""), IDLE_TIME);
  }

  fold() {
    this.ui.fold.ariaExpanded = !this.node.toggleAttribute("data-folded");
  }

  showTab(name) {
    this.node.dataset.tab = name;
    this.node.removeAttribute("data-folded");
    this.ui.fold.ariaExpanded = true;
    for (const tab of this.node.querySelectorAll("button[data-tab]"))
      tab.ariaPressed = tab.dataset.tab === name;
    this.redraw();
  }

  // ---- what the program sends

  lost(text = "The program does not answer; waiting for it …") {
    this.ui.role.textContent = text;
    this.ui.busy.hidden = true;
  }

  receive(data) {
    if (typeof data !== "string") return this.showState(data);
    const message = JSON.parse(data);
    const { kind } = message;
    this.answered();
    if (kind === "hello") this.showHello((this.hello = message));
    else if (kind === "scene") this.showScene(message);
    else if (kind === "graphs") this.showGraphs(message);
    else if (kind === "panel") this.showPanel(message);
    else if (kind === "yaml") this.showSaved(message);
    else if (kind === "film") {
      this.showFilm(false);
      if (message.page) download(message.page, "disk.html", "text/html"); // or a message says why not
    }
  }

  showFilm(isAwaited) {
    const button = this.ui["film-page"];
    button.disabled = isAwaited;
    button.textContent = isAwaited ? "The film is made …" : "Film to play with";
  }

  showHello({ keys }) {
    this.ui.role.textContent = "";
    this.ui.busy.textContent = "one moment …";
    this.showFilm(false); // a program that was lost makes none
    const row = ([key, what]) => [element("dt", {}, key), element("dd", {}, what)];
    this.ui.reference.replaceChildren(...[...keys, ...this.shortcuts].flatMap(row));
  }

  showSaved({ text, outline, name }) {
    Object.assign(this, { scene: text, outline, outlineName: name });
    this.ui.svg.hidden = !outline;
    this.stroke = []; // it has become a body
  }

  showScene(message) {
    this.drawing.setScene(message);
    const { unused } = message.labels;
    for (const id of ["hit", "slow", "arrow"]) this.ui[id].disabled = unused.includes(id);
    this.ui.aiming.hidden = this.ui.arrow.disabled;
  }

  showState(buffer) {
    this.state = unpacked(buffer, this.hello.columns, this.hello.curves.length);
    this.arrived = performance.now();
    this.graphs.add(this.state);
    this.isAtEnd = this.state.caption.includes("\n*");
    this.hasLeft = this.isAtEnd && !this.state.row.load; // gravity, a load, would bring it back
    this.ui.caption.replaceChildren(...this.state.caption.split("\n").map(captionLine));
    if (this.panel) this.showTexts(this.panel);
    this.answered();
    this.redraw(this.state.number);
  }

  // Note that the program is not busy.
  answered() {
    this.waiting = clearTimeout(this.waiting);
    this.ui.busy.hidden = true;
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
    const { drawing, state, panel, ui } = this;
    const canAim = panel.atStart && !ui.arrow.disabled;
    const arrow = this.shownVelocity();
    const isAimed = Boolean(panel.aimed);
    drawing.set({ ...checked(ui.options), arrow, canAim, isAimed, letters: this.letters });
    drawing.draw(state);
    this.node.style.setProperty("--legend", `${drawing.footer}px`);
    const { theme } = drawing;
    const pulled = 2 * state.pulled;
    if (pulled >= 0 && this.target) {
      const point = [state.x[pulled], state.x[pulled + 1]];
      drawing.drawArrow(point, this.target, theme.accent, theme);
    }
    if (this.stroke.length) drawing.drawStroke(this.stroke, this.crossing, theme);
    this.graphs.draw(state, theme, drawing.options.theme, this.letters);
    if (panel.again < 1) return;
    ui.timeline.max = Math.max(this.graphs.data?.t.at(-1) ?? 1, 1e-3);
    ui.timeline.value = state.t;
  }

  // Size of the letters over the usual one: larger on a large screen, and for a projector, if the
  // legend has room.
  get letters() {
    const least = Math.max((LETTER_PART * this.node.clientHeight) / LETTERS, 1);
    if (!this.node.hasAttribute("data-projector")) return least;
    const { clientWidth: width, clientHeight: height } = this.ui.disk;
    const room = Math.min(width / LEGEND_WIDTH, height / READABLE_HEIGHT);
    const row = width / LEGEND_ROW; // at most this size leaves the legend in one row
    const most = Math.max(2, height / LARGE_HEIGHT); // a 4K projector has twice as many pixels
    return Math.max(Math.min(Math.max(room, 1), row < 1.4 ? most : Math.min(row, most)), least);
  }

  // Draw for paper, which is white.
  print() {
    this.node.dataset.theme = "light";
    this.drawing.set({ theme: "light" });
    this.draw();
  }

  // Return the velocity whose arrow is drawn: that of the throw, while it is aimed, or the disk's.
  shownVelocity() {
    const { panel, state, ui } = this;
    if (panel.aimed) {
      const [speed, angle] = panel.aimed;
      return [speed * Math.sin(angle), -speed * Math.cos(angle)];
    }
    const isShown = ui.arrow.checked && !ui.arrow.disabled;
    return isShown ? [state.row.com_vx, state.row.com_vy] : null;
  }

  showGraphs(message) {
    const { curves } = this.hello;
    const [motion, unit] = message.motion;
    this.graphs.replace(message, curves);
    const before = this.graphs.before ? "; dotted: the throw before" : "";
    this.ui.energies.textContent = `energies [Mc²]${before}`;
    const names = ["force of the wall [Mc²/R], left", `${motion} [${unit}], right`];
    const span = ([, , light, dark], k) => element("span", { style: inks(light, dark) }, names[k]);
    this.ui.motions.replaceChildren(...curves.slice(-2).map(span));
  }

  showPanel(panel) {
    const { ui, node, drawing } = this;
    const isFirst = !this.panel;
    this.panel = panel;
    const specs = [...panel.sliders, ...panel.choices];
    const value = (name) => specs.find(({ key }) => key === `video.${name}`).value;
    this.controls.show(specs);
    drawing.set({
      theme: value("theme"),
      draw: value("draw"),
      quantity: value("colour"),
      magnify: value("magnify"),
    });
    node.dataset.theme = value("theme");
    this.showTexts(panel);
    this.showMessage(panel, isFirst);
    ui.warnings.replaceChildren(...panel.warnings.map((text) => element("li", {}, text)));
    ui.status.className = panel.status.startsWith("same") ? "" : "disturbed";
    ui.slow.checked = panel.slow;
    node.toggleAttribute("data-again", panel.again < 1);
    ui.again.hidden = panel.again === 1;
    ui.again.value = panel.again;
    const results = JSON.stringify([panel.results, drawing.scene.labels.curve]);
    if (results !== this.shownResults) this.showResults();
    this.shownResults = results;
    if (panel.number !== this.shownNumber) {
      this.graphs.before = null;
      showScenes(ui.entries, this.hello.playlist, panel.number);
      this.shownNumber = panel.number;
    }
    node.ariaBusy = false; // all that was empty until now is filled
    if (isFirst && (this.theme || value("theme") === "light")) this.takeTheme();
    if (isFirst && this.isExpected && panel.atStart) this.send({ do: "press", key: "space" });
    this.redraw();
  }

  showTexts(panel) {
    const { ui, drawing } = this;
    const { labels } = drawing.scene;
    const next = this.hasLeft ? `${labels.drop} again` : "Go on";
    const go = panel.atStart ? labels.drop : next;
    const count = panel.results.length;
    const texts = {
      drop: panel.paused ? go : "Pause",
      scenes: `${panel.name} ▾`,
      sentence: this.sentence,
      lattice: `Another random lattice (now ${panel.seed})`,
      status: panel.status,
      aiming: panel.atStart ? "Drag the disk to turn it, or beside it to aim." : "Drag the disk to pull it.",
      collect: panel.collecting ? `Stop (${panel.collecting} left)` : labels.collect,
      "tab-results": count ? `Results (${count})` : "Results",
    };
    for (const [id, text] of Object.entries(texts)) ui[id].textContent = text;
  }

  // The scene's question; after the throw, of which the caption has the result, its answer.
  get sentence() {
    return (this.isAtEnd && this.panel.answer) || this.panel.question;
  }

  // Show a new message in place of the sentence for a while. A message that was there before this
  // page is old.
  showMessage({ aimed, message, refusals, hint }, isFirst) {
    if (isFirst) this.oldMessage = message;
    else if (message !== this.oldMessage) this.oldMessage = "";
    const isNew = message !== this.oldMessage;
    let text = isNew && message ? message : hint;
    if (aimed) {
      const [speed, angle] = aimed;
      text = `v = ${speed} c, angle ${((angle * 180) / Math.PI).toFixed(1)}° = ${angle} rad`;
    }
    const key = `${refusals} ${text}`; // a number that is refused again has the same text
    if (key === this.shownMessage) return;
    this.shownMessage = key;
    // a place in a stroke, whose file is none of the user's
    const [, fault, x, y] = /svg: (.*?[[(](\S+?),? (\S+)[\])].*)/.exec(text) ?? [];
    this.crossing = this.stroke.length && x ? [Number(x), Number(y)] : null;
    this.say(this.crossing ? fault : text);
  }

  // Show a text in place of the sentence for a while.
  say(text) {
    const { ui, node } = this;
    ui.message.textContent = text;
    node.toggleAttribute("data-message", Boolean(text));
    clearTimeout(this.messageTimer);
    this.messageTimer = setTimeout(() => node.removeAttribute("data-message"), MESSAGE_TIME);
  }

  showResults() {
    const { ui, panel, drawing } = this;
    const { results } = panel;
    for (const id of ["copy", "csv", "clear"]) ui[id].disabled = !results.length;
    showResults(ui.table, results);
    const title = drawing.scene.labels.curve;
    const options = { title, range: panel.loadRange, fitted: ui.eq5.checked };
    showDiagram(ui.diagram, ui.curve, results, options);
  }
}
