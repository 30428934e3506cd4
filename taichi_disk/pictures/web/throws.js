// Throws of a film's disk with other numbers: sliders, the address of a throw, its task, and a table.

import { Again, diskOf } from "./again.js";
import { Controls, digits, notRead, readNumber } from "./controls.js";
import { copy, store } from "./html.js";
import { COPIED, asText, showDiagram, showResults } from "./results.js";
import { throwing } from "./stepper.js";

const DONE = 0.00301; // largest distance of e, as it is shown, from the goal: 0.003, and rounding
const NUMBERS = [
  { key: "v", name: "speed", symbol: "v", unit: "c", of: "impact.velocity" },
  { key: "eta", name: "viscosity", symbol: "η*", unit: "", of: "material.eta_star" },
];
// names of the numbers in an address, and what is between two numbers, as people write and programs change it
const ADDRESS_NAMES = ["v speed velocity impact.velocity", "eta eta* eta_star viscosity material.eta_star η* η", "goal task video.goal"];
const BETWEEN = /&amp;|[&;]|[\s,+]+(?=[^\s=&;,]+\s*=)/;
const ADDED = /^(fbclid|gclid|mibextid|igsh|utm_.*)$/; // by other programs
const LONGEST = 300; // letters of an address that are read
const USUAL_GOAL = 0.9;
// what a row of results.js has beside a throw's numbers
const ROW = { result: "e", wall: null, a: null, points: null, angle: 0, spin: 0, friction: 0 };
const SLICE = 20; // time between two answers of the page [ms]
const PATIENCE = 300; // time after which the page shows how far a throw is [ms]

// Return the numbers in an address, and sentences about what is not read.
function readAddress(address) {
  const numbers = {};
  const faults = [];
  // A link within another is encoded up to the next &.
  const link = address.replace(/^[^#]*?%23([^&=]*)(&.*)?$/s, "#$1").replace("%23", "#");
  const end = link.slice(link.indexOf("#") + 1);
  const unread = end.length > LONGEST ? [`what follows ${LONGEST} letters`] : [];
  // URLSearchParams decodes, without an error for what is no code. Some programs encode twice.
  const plain = (code) => new URLSearchParams(`all=${code.replace(/[&+]/g, encodeURIComponent)}`).get("all");
  const text = plain(plain(end.slice(0, LONGEST))).replace(/[^\p{L}\p{N}%&=;]+$/u, ""); // brackets, a full stop
  if (text.endsWith("&")) unread.push("what followed the last &");
  for (const part of text.split(BETWEEN).filter((one) => /[^\s:]\s*$/.test(one))) { // no “Anna:”
    const [before, value = ""] = part.split(/=(.*)/s).map((one) => one.trim());
    const name = before.match(/[\p{L}\d_.*]+(?=[^\p{L}\d_.*]*$)/u)?.[0] ?? before; // the last word
    if (ADDED.test(name.toLowerCase())) continue;
    const key = ADDRESS_NAMES.find((names) => names.split(" ").includes(name.toLowerCase()))?.split(" ")[0];
    const number = key === "goal" && /^none$/i.test(value) ? 0 : readNumber(value);
    if (!key || key in numbers) unread.push(key ? `${name}, a second time` : before.slice(0, 40));
    else if (Number.isNaN(number)) faults.push(`${name}: ${notRead(value)}.`);
    else numbers[key] = number;
  }
  if (unread.length) faults.push(`Not read: ${unread.join(", ").slice(0, 200)}; write v, eta, goal.`);
  return { numbers, faults };
}

// Attributes: rows, of all throws; goal: part of its speed with which the disk is to come back, or 0;
// asked: numbers of the last throw; flight: that of the film, once it has shown its e.
export class Throws {
  // `take` is called with each throw, which the film then shows
  constructor(ui, film, scene, take) {
    const { sliders, velocity: v, eta_star: eta, goal } = film.again;
    Object.assign(this, { ui, film, take, disk: diskOf(film.again, scene), own: { v, eta, goal: Number(goal) || 0 } });
    this.tell = (text) => (ui.told.textContent = text);
    this.place = `taichi-disk throws ${ui.states.textContent.slice(-12)}`; // of this film's in the store
    this.rows = JSON.parse(store[this.place] ?? "[]");
    this.numbers = NUMBERS.map(({ of, ...one }) => {
      const all = [...sliders[of], this.own[one.key]];
      return { ...one, low: Math.min(...all), high: Math.max(...all), meaning: "of the throw", live: true };
    });
    this.refuse = (text) => (ui.unread.textContent = text); // which stays, unlike what is told
    const set = (key, value) => this.refuse(this.want({ ...this.wanted, [key]: value }));
    this.sliders = new Controls(() => ui.numbers, set, this.refuse);
    ui.throws.hidden = ui.list.hidden = false;
    document.querySelector("main").classList.add("throws");
    ui.throw.onclick = () => this.throw(true);
    ui.stop.onclick = () => {
      this.end();
      this.tell("Stopped: Throw begins again.");
    };
    ui.link.onclick = () => this.copyLink(this.link(this.wanted));
    ui.task.onclick = () => this.set(this.goal ? 0 : readNumber(ui.share.value) / 100, true);
    ui.share.onchange = () => {
      const text = ui.share.value;
      const fault = this.set(readNumber(text.replace("%", "")) / 100 || NaN, true);
      this.refuse(fault && `“${text.slice(0, 40)}” is no goal: write a number from 1 to 100.`);
    };
    ui.copy.onclick = () => copy(asText(ui.table, "\t"), this.tell, COPIED);
    ui.addresses.onchange = () => this.collect();
    ui.table.onclick = ({ target }) => {
      if (target.dataset.remove) this.rows.splice(target.dataset.remove, 1);
      this.showList();
    };
    ui.list.ontoggle = () => this.showList();
    window.onhashchange = () => this.obey();
    this.set(this.own.goal || USUAL_GOAL); // which Task brings back, until another was set
    this.obey();
  }

  // Throw as the address says, beginning from the film's own numbers.
  obey() {
    const { numbers: asked } = readAddress(location.search.slice(1)); // courses add words of their own there
    const { numbers, faults } = readAddress(location.hash);
    const wanted = { ...this.own, ...asked, ...numbers };
    this.refuse(this.want(wanted));
    const noGoal = this.set(wanted.goal);
    if (noGoal) this.set(this.own.goal);
    this.throw();
    this.tell([...faults, noGoal].join(" ").trim());
  }

  // Return sentences about numbers beyond the sliders.
  beyond(numbers) {
    const outside = this.numbers.filter(({ key, low, high }) => numbers[key] < low || numbers[key] > high);
    const end = ({ key, low, high }) => (numbers[key] > high ? high : low);
    return outside.map((one) => `${digits(numbers[one.key])} is beyond the slider: ${end(one)}.`).join(" ");
  }

  // Take numbers, as far as the sliders go, and return `beyond`.
  want(numbers) {
    const clipped = ({ key, low, high }) => [key, Math.min(Math.max(numbers[key], low), high)];
    this.wanted = Object.fromEntries(this.numbers.map(clipped));
    this.sliders.show(this.numbers.map((one) => ({ ...one, value: this.wanted[one.key] })));
    return this.beyond(numbers);
  }

  // Set the task, or none for 0. Return a sentence if it is no task. `isNew`: the address shall say so.
  set(goal, isNew) {
    const { ui } = this;
    const isGoal = goal === 0 || (goal >= 0.01 && goal <= 1);
    if (isGoal) this.goal = goal;
    const share = goal > 1 && goal <= 100 ? goal : 100 * USUAL_GOAL;
    ui.goal.hidden = !this.goal;
    if (this.goal) ui.share.value = digits(100 * this.goal); // else the last one stays there
    ui.task.textContent = this.goal ? "Clear task" : "Task";
    this.judge();
    if (isNew) this.write();
    return isGoal ? "" : `${digits(goal)} is no goal: write ${digits(share / 100)}, or ${digits(share)} %.`;
  }

  // Return the end of the address of a throw.
  link({ v, eta }) {
    const { goal, own } = this;
    const task = goal || own.goal ? `&goal=${goal ? digits(goal) : "none"}` : "";
    return `#v=${v}&eta=${eta}${task}`;
  }

  // Write the last throw into the address; in some frames it cannot be written.
  write() {
    if (location.protocol !== "about:") history.replaceState(null, "", this.link(this.asked));
  }

  copyLink(link) {
    const isShared = /^https?:$/.test(location.protocol);
    const page = isShared ? location.href.split("#")[0] : "";
    const other = `Copied ${link}: send the file, too. Whoever opens it adds this to the end of its address.`;
    copy(page + link, this.tell, isShared ? "Copied: send it, or open it." : other);
  }

  // Show how much of a throw is done, from 0 to 1; nothing: the page does not throw.
  show(part) {
    const { throws, bar, throw: button } = this.ui;
    throws.classList.toggle("busy", part !== undefined);
    bar.value = part ?? 0;
    button.textContent = part === undefined ? "Throw" : `${Math.floor(100 * part)} %`;
  }

  // End what is computed.
  end() {
    this.job = null;
    if (document.activeElement === this.ui.stop) this.ui.throw.focus(); // before Stop is hidden
    this.show();
  }

  // Return the throw with these numbers, and write it into the table. It is computed in slices, between
  // which the page answers; return nothing if it is ended, by a new throw or by the user.
  async thrown({ v, eta }) {
    const job = (this.job = {});
    const steps = throwing(this.disk, v, eta);
    const { port1, port2 } = new MessageChannel(); // a timer is held back while the page is hidden
    const began = performance.now();
    let [next, duration] = [{}, 0];
    while (!next.done) {
      const start = performance.now();
      while (!next.done && performance.now() < start + SLICE) next = steps.next();
      duration += performance.now() - start;
      if (!next.done && performance.now() > began + PATIENCE) this.show(next.value);
      await new Promise((done) => {
        window.onpageshow = port1.onmessage = done; // Firefox drops the message if the page is left
        port2.postMessage(null);
      });
      if (this.job !== job) return null;
    }
    this.end();
    const one = new Again(this.disk, this.film, next.value, duration);
    const row = { ...ROW, load: v, eta_star: eta, disturbance: one.folded ? "folded" : "" };
    const isKnown = this.rows.some((old) => old.load === v && old.eta_star === eta);
    if (!isKnown) this.rows.push({ ...row, value: next.value.restitution });
    this.showList();
    return one;
  }

  // Throw the disk. `isNew`: the address shall say so.
  async throw(isNew) {
    const { ui, wanted } = this;
    this.asked = wanted;
    this.tell("");
    const one = await this.thrown(wanted);
    if (!one) return;
    this.judge(null);
    this.take(one);
    const { flight, folded, duration } = one;
    const steps = Math.round(flight.rows[flight.end].t / flight.dt).toLocaleString("en");
    ui.steps.textContent = `${steps} steps in ${Math.round(duration)} ms, as run with velocity_verlet`;
    if (folded) this.tell(`${folded} triangles turned inside out: e means nothing. Throw slower.`);
    if (isNew) this.write();
    if (ui.addresses.value) this.collect();
  }

  // Show e, when the film does, and how near it comes to the task. Both stay until the next throw.
  judge(flight = this.flight) {
    this.flight = flight;
    const { restitution: e, speed: v, etaStar: eta } = flight ?? {};
    const { goal, ui } = this;
    const [speed, viscosity] = this.numbers;
    const isDone = Math.abs(e?.toFixed(3) - goal) < DONE;
    const more = [eta < viscosity.high && "more viscosity", v < speed.high && "a faster throw"];
    const less = [eta > viscosity.low && "less viscosity", v > speed.low && "a slower throw"];
    const ways = (e > goal ? more : less).filter(Boolean).join(", or ") || "the sliders go no further";
    const advice = isDone ? ": the task is done ★" : `, too ${e > goal ? "large" : "small"}: ${ways}`;
    const result = e ? `e = ${e.toFixed(3)}` : "";
    const text = goal && e ? result + advice : result;
    if (ui.verdict.textContent !== text) ui.verdict.textContent = text; // which a screen reader says
  }

  // Throw what the pasted addresses say, one after the other. What is ended follows the next throw; what is
  // refused stays, to be corrected.
  async collect() {
    const { ui } = this;
    const links = ui.addresses.value.replace(/\s*\n(?=\s*&)|(?<=&|&amp;)\s*\n/g, ""); // a mail breaks them
    const lines = links.split(/\n|(?<==\S*),?\s+(?=[^=]*#)/).filter((line) => line.trim()); // a chat joins them
    ui.faults.textContent = "";
    const left = new Set(lines);
    for (const line of left) {
      const { numbers, faults } = readAddress(line);
      const one = { ...this.own, ...numbers };
      const problem = [...faults, this.beyond(one)].join(" ").trim();
      if (problem) ui.faults.append(`${line.trim().slice(0, 60)}: ${problem}\n`);
      else if (await this.thrown(one)) left.delete(line);
      else return;
      ui.addresses.value = [...left].join("\n");
    }
  }

  showList() {
    const { ui, rows, numbers } = this;
    store[this.place] = JSON.stringify(rows);
    if (!ui.list.open) return;
    showResults(ui.table, rows);
    const title = "restitution e over the speed v [c]";
    const range = [numbers[0].low, numbers[0].high];
    showDiagram(ui.diagram, ui.curve, rows, { title, range, fitted: false });
  }
}
