// A stage for the modules of a page: time, frames, the socket and canvases are stand-ins, so that
// what the page draws, shows and sends becomes lines of text on each machine and in each browser.

const stage = {
  lines: [], // notes
  drawn: [], // in the present step, ...
  lastDrawn: [], // ... the last one that drew, ...
  everDrawn: new Set(), // ... and all
  timers: [],
  frames: [],
  observers: [],
  sockets: [],
  clock: 0, // [ms]
};
Math.random = () => 0.1234;
const note = (text) => stage.lines.push(text.replace(/\n/g, " ¶ "));
// Say more about what was noted last.
const remark = (text) => note(`${stage.lines.pop()}; ${text}`);
const rounded = (value) => Number(value.toFixed(Math.abs(value) < 1 ? 4 : 2)) || 0;
const plain = (_, value) => (typeof value === "number" ? rounded(value) : value);
const pairs = (points) =>
  points.map((place) => (Array.isArray(place) ? place.map(rounded).join() : place)).join(" ");

// What a path and a canvas's context know, of calls that the page makes.
class Route {
  points = [];
  moveTo(...place) {
    this.points.push("from", place);
  }
  lineTo(...place) {
    this.points.push(place);
  }
  arc(...values) {
    this.points.push("arc", values);
  }
}

class Pen extends Route {
  constructor(canvas) {
    super();
    Object.assign(this, { canvas, factor: 1, saved: [], dash: [], globalAlpha: 1, shadowBlur: 0 });
  }
  setTransform(factor) {
    this.factor = factor;
  }
  scale(factor) {
    this.factor *= factor;
  }
  save() {
    this.saved.push(this.factor);
  }
  restore() {
    this.factor = this.saved.pop();
  }
  beginPath() {
    this.points = [];
  }
  setLineDash(dash) {
    this.dash = dash;
  }
  write(act, colour, ...words) {
    const factor = this.factor === 1 ? "" : ` × ${rounded(this.factor)}`;
    const alpha = this.globalAlpha === 1 ? "" : ` alpha ${this.globalAlpha}`;
    const blur = this.shadowBlur ? ` blur ${rounded(this.shadowBlur)}` : "";
    stage.drawn.push(`  ${act} ${colour}${alpha}${blur}${factor} ${words.join(" ")}`);
  }
  stroke(route = this) {
    const dash = this.dash.map(rounded).join();
    const width = rounded(this.lineWidth);
    this.write("stroke", this.strokeStyle, `${width} wide [${dash}]`, pairs(route.points));
  }
  fill(route = this) {
    const line = pairs(route.points);
    const last = stage.drawn.at(-1);
    const isStroked = last?.startsWith(`  stroke ${this.fillStyle} `) && last.endsWith(line);
    if (isStroked) stage.drawn[stage.drawn.length - 1] += " filled";
    else this.write("fill", this.fillStyle, line);
  }
  fillRect(...box) {
    // of the columns of a colour scale, a few
    if (box[2] === 1.5) this.columns = (this.columns ?? -1) + 1;
    if (box[2] !== 1.5 || this.columns % 90 === 0) this.write("rect", this.fillStyle, pairs([box]));
  }
  clearRect() {}
  fillText(text, ...place) {
    this.write("text", this.fillStyle, this.font, this.textAlign, this.textBaseline, pairs([place]), text);
  }
  strokeText(text, ...place) {
    this.write("rim", this.strokeStyle, `${this.lineWidth} wide`, pairs([place]), text);
  }
  measureText(text) {
    return { width: 7 * text.length };
  }
  drawImage(image, ...box) {
    this.write("image", `${image.width} x ${image.height}`, pairs([box]));
  }
  createImageData(width, height) {
    return new ImageData(width, height);
  }
  putImageData() {}
}

const fail = (text) => (window.recorded = `the page fails: ${text}`);
window.onerror = fail;
window.onunhandledrejection = ({ reason }) => fail(reason);
window.Path2D = Route;
HTMLCanvasElement.prototype.getContext = function () {
  return (this.pen ??= new Pen(this));
};
HTMLCanvasElement.prototype.toBlob = (done) => done(new Blob());
HTMLCanvasElement.prototype.setPointerCapture = () => {};
// Preferences of the system, by what a page asks.
const media = {};
window.matchMedia = (query) => (media[query] ??= { matches: false });
const later = setTimeout.bind(window);
performance.now = () => stage.clock;
window.setTimeout = (act, time) => stage.timers.push({ act, due: stage.clock + time });
window.setInterval = (act, time) => stage.timers.push({ act, due: stage.clock + time, time });
window.clearTimeout = (number) => {
  if (number) stage.timers[number - 1].due = Infinity;
};
window.requestAnimationFrame = (act) => stage.frames.push(act);
class Observer {
  constructor(act) {
    stage.observers.push(act);
  }
  observe() {}
}
window.ResizeObserver = Observer;
window.IntersectionObserver = Observer;
window.devicePixelRatio = 1;
window.WebSocket = class {
  static OPEN = 1;
  readyState = 1;
  constructor(address) {
    note(`  socket ${address.replace(/.*\//, "")}`);
    stage.sockets.push(this);
  }
  send(text) {
    const message = JSON.parse(text);
    const isSeen = message.do === "seen";
    if (isSeen && message.number === stage.seen) return;
    const sent = JSON.stringify(message, plain);
    if (stage.lines.at(-1)?.startsWith("  send ")) stage.lines.push(`${stage.lines.pop()} ${sent}`);
    else note(`  send ${sent}`);
    if (isSeen) stage.seen = message.number;
  }
  close() {
    note("  socket closed");
  }
};
window.fetch = async () => ({ text: async () => "nobody is at home" });
const contents = new WeakMap();
window.Blob = class extends Blob {
  constructor(parts, options) {
    super(parts, options);
    contents.set(this, parts?.join("") ?? "");
  }
};
URL.createObjectURL = (blob) => `data:${blob.type},${contents.get(blob)}`;
HTMLAnchorElement.prototype.click = function () {
  note(`  download ${this.download}: ${decodeURI(this.getAttribute("href"))}`);
};
HTMLElement.prototype.requestFullscreen = async () => note("  full screen");

// Let time pass [ms].
function wait(time) {
  const end = stage.clock + time;
  for (;;) {
    const due = stage.timers.filter((one) => one.due <= end);
    if (!due.length) break;
    const next = due.reduce((first, one) => (one.due < first.due ? one : first));
    stage.clock = next.due;
    next.due = next.time ? next.due + next.time : Infinity;
    next.act();
  }
  stage.clock = end;
}

function drawFrame() {
  for (const act of stage.frames.splice(0)) act(stage.clock);
}

// Return the words and numbers of an element.
function worded(node) {
  const words = [...node.attributes]
    .filter(({ name }) => !/^(id|type|min|step)$/.test(name))
    .map(({ name, value }) => (value ? `${name}="${value}"` : name))
    .sort();
  for (const name of ["value", "checked", "disabled"]) {
    if (node[name] && node.matches("input, select, button, progress")) words.push(`${name}: ${node[name]}`);
  }
  const texts = [...node.childNodes].map((one) => (one.nodeType === 3 ? one.data.trim() : ""));
  const line = [...words, ...texts].join(" ").trim();
  return line.replace(/-?\d+\.\d{3,}/g, (number) => rounded(Number(number)));
}

const named = (node) => (node.id ? `#${node.id} ${worded(node)}` : worded(node));

// Return a line for each element that says something; what is read together has one line.
const TOGETHER = "tr, dl, select, label, figure, .slider, .plot, .cards > button";
function described(root) {
  const lines = [];
  const visit = (node, place) => {
    const tag = node.id ? `#${node.id}` : node.localName;
    const isLine = node.matches(TOGETHER);
    const parts = isLine ? [...node.querySelectorAll("*")].map(named) : [];
    const words = [worded(node), ...parts].filter(Boolean).join(" | ");
    if (words) lines.push(`  ${place}${tag}: ${words}`);
    if (isLine) return;
    for (const one of node.children) visit(one, node.id ? `${tag} ` : place);
  };
  visit(root, "");
  return lines;
}

// Perform an act, and note what it sends, how much it draws, and what is shown that was not shown
// before it. `look` also notes what is drawn for the first time.
const step = (name, act) => perform(name, act, false);
const look = (name, act) => perform(name, act, true);

// Join lines: a rim with what it surrounds, the number of an axis with its tick, columns of a scale.
function joined(lines) {
  const found = [];
  for (const line of lines) {
    const last = found.at(-1) ?? "";
    const below = found.slice(-2).find((one) => {
      const shape = one.split(" wide ")[1];
      return shape && line.endsWith(` ${shape}`);
    });
    const isTicked = line.startsWith("  text") && /^  stroke (rule|faint) .* 1 wide [^t]*$/.test(last);
    const isColumn = [line, last].every((one) => one.startsWith("  rect rgb"));
    if (isTicked || isColumn) found.push(`${found.pop()}${line.slice(1)}`);
    else if (below) {
      found.splice(found.lastIndexOf(below), 1);
      found.push(`${line} on ${below.trim().split(" wide ")[0]}`);
    } else found.push(line);
  }
  return found;
}

// Note lines, and those that begin as the line before in one.
function noteAlike(lines, beginning) {
  let before = "none";
  for (const line of lines) {
    if (line.startsWith(`${before} `)) note(`${stage.lines.pop()};${line.slice(before.length)}`);
    else note(line);
    before = line.match(beginning)?.[0] ?? "none";
  }
}

function perform(name, act, isLooked) {
  const title = stage.lines.push(name) - 1;
  act?.();
  drawFrame();
  const { drawn, everDrawn } = stage;
  const news = new Set(isLooked ? joined(drawn).filter((line) => !everDrawn.has(line)) : []);
  for (const line of news) everDrawn.add(line);
  noteAlike(news, /^  (stroke|text|fill) \S+( of \S+)?/);
  const same = drawn.filter((line) => stage.lastDrawn.includes(line)).length;
  if (drawn.length) {
    stage.lines[title] += `; ${drawn.length} strokes and texts, ${same} as before`;
    stage.lastDrawn = drawn;
  }
  stage.drawn = [];
  const shown = described(stage.root);
  const newlyShown = shown.filter((line) => !stage.shown.includes(line));
  noteAlike(newlyShown, /^  #\S+(?=.{0,110}$)/);
  const gone = stage.shown.filter((line) => !shown.includes(line)).length;
  if (gone) stage.lines[title] += `; ${gone} lines are gone`;
  stage.shown = shown;
}

const packed = (array) => btoa(String.fromCharCode(...new Uint8Array(array.buffer)));
const pointer = (node, kind, x, y, more = {}) => {
  const options = { bubbles: true, pointerId: 1, button: 0, buttons: 1, ...more };
  const event = new PointerEvent(kind, options);
  Object.defineProperties(event, { offsetX: { value: x }, offsetY: { value: y } });
  node.dispatchEvent(event);
};
