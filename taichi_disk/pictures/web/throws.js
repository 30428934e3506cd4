// Throws of a film's disk with other numbers: sliders, the address of a throw, its task, and a table.

import { Again, diskOf } from "./again.js";
import { Controls, digits } from "./controls.js";
import { copy } from "./html.js";
import { asText, showDiagram, showResults } from "./results.js";

// Words for the distance of e from the one that is wanted.
const VERDICTS = [
  [0.003, "★★★ Exactly!"],
  [0.01, "★★ So close!"],
  [0.03, "★ Near."],
];
const NUMBERS = [
  { key: "v", name: "speed", symbol: "v", unit: "c", of: "impact.velocity" },
  { key: "eta", name: "viscosity", symbol: "η*", unit: "", of: "material.eta_star" },
];
// what a row of results.js has beside a throw's numbers
const ROW = { result: "e", wall: null, a: null, points: null, angle: 0, spin: 0, friction: 0 };

// Return the numbers in an address.
function numbersOf(address) {
  const words = new URLSearchParams(address.slice(address.indexOf("#") + 1));
  return Object.fromEntries([...words].map(([key, text]) => [key, parseFloat(text)]));
}

export class Throws {
  rows = [];

  // `take` is called with each throw, which the film then shows
  constructor(ui, film, scene, take) {
    const { sliders, velocity, eta_star } = film.again;
    Object.assign(this, { ui, film, take, disk: diskOf(film.again, scene) });
    this.wanted = { v: velocity, eta: eta_star };
    this.numbers = NUMBERS.map(({ of, ...one }) => {
      const all = [...sliders[of], this.wanted[one.key]];
      return { ...one, low: Math.min(...all), high: Math.max(...all) };
    });
    const tell = (text) => (ui.told.textContent = text);
    this.sliders = new Controls(
      () => ui.numbers,
      (key, value) => this.want({ [key]: value }),
      tell,
    );
    ui.throws.hidden = ui.list.hidden = false;
    document.querySelector("main").classList.add("throws");
    ui.throw.onclick = () => {
      this.throw();
      if (location.protocol !== "about:") history.replaceState(null, "", this.link);
    };
    const page = location.protocol === "about:" ? "" : location.href.split("#")[0];
    ui.link.onclick = () => copy(page + this.link).then(() => tell("Copied: send it, or open it."));
    ui.copy.onclick = () => copy(asText(ui.table, "\t"));
    ui.addresses.onchange = () => this.collect();
    ui.table.onclick = ({ target }) => {
      if (target.dataset.remove) this.rows.splice(target.dataset.remove, 1);
      this.showList();
    };
    ui.list.ontoggle = () => this.showList();
    window.onhashchange = () => this.obey();
    this.obey();
    if (this.rows.length) return;
    // An address that is refused shows the film's own throw.
    const refusal = ui.told.textContent;
    this.want({ v: velocity, eta: eta_star });
    this.throw();
    tell(refusal);
  }

  // Take numbers, as far as the sliders go.
  want(numbers) {
    for (const { key, low, high } of this.numbers) {
      const value = numbers[key];
      if (Number.isFinite(value)) this.wanted[key] = Math.min(Math.max(value, low), high);
    }
    const live = { meaning: "of the throw", live: true };
    this.sliders.show(this.numbers.map((one) => ({ ...one, ...live, value: this.wanted[one.key] })));
    this.ui.told.textContent = "";
  }

  // The end of the address of a throw.
  get link() {
    const { wanted, goal } = this;
    return `#${new URLSearchParams(goal ? { ...wanted, goal } : wanted)}`;
  }

  obey() {
    const said = numbersOf(location.hash);
    this.goal = said.goal > 0 && said.goal <= 1 ? said.goal : NaN;
    this.want(said);
    this.throw();
  }

  // Return the throw with these numbers, and write it into the table.
  thrown({ v, eta }) {
    const one = new Again(this.disk, this.film, v, eta);
    const row = { ...ROW, load: v, eta_star: eta, disturbance: one.folded ? "folded" : "" };
    const isKnown = this.rows.some((old) => old.load === v && old.eta_star === eta);
    if (!isKnown) this.rows.push({ ...row, value: one.flight.restitution });
    return one;
  }

  throw() {
    const { told } = this.ui;
    try {
      const one = this.thrown(this.wanted);
      this.take(one);
      const { flight, folded, duration } = one;
      const steps = Math.round(flight.rows[flight.end].t / flight.dt).toLocaleString("en");
      told.textContent = `${steps} steps in ${Math.round(duration)} ms, as run with velocity_verlet`;
      if (folded) told.textContent = `${folded} triangles turned inside out: e means nothing. Throw slower.`;
    } catch (error) {
      told.textContent = error.message;
    }
    this.showList();
  }

  // Show the task, and after the throw how near it came.
  judge(e) {
    const { goal, ui } = this;
    const near = VERDICTS.find(([most]) => Math.abs(e - goal) < most);
    const words = near?.[1] ?? (e > goal ? "Too lively." : "Too dull.");
    const task = `Make it come back with ${digits(100 * goal)} % of its speed.`;
    ui.goal.textContent = goal ? `${task} ${e ? words : ""}` : "";
  }

  // Throw what the pasted addresses say, one after the other, so that the page stays alive.
  async collect() {
    const { ui, numbers } = this;
    const lines = ui.addresses.value.split("\n").map((line) => line.trim());
    ui.addresses.value = ui.faults.textContent = "";
    for (const line of lines.filter(Boolean)) {
      const said = numbersOf(line);
      const isThrow = numbers.every(({ key, low, high }) => said[key] >= low && said[key] <= high);
      try {
        if (!isThrow) throw new Error("not the address of a throw of this disk");
        this.thrown(said);
      } catch (error) {
        ui.faults.append(`${line.slice(0, 60)}: ${error.message}\n`);
      }
      this.showList();
      await new Promise((done) => setTimeout(done));
    }
  }

  showList() {
    const { ui, rows, numbers } = this;
    if (!ui.list.open) return;
    showResults(ui.table, rows);
    const title = "restitution e over the speed v [c]";
    const range = [numbers[0].low, numbers[0].high];
    showDiagram(ui.diagram, ui.curve, rows, { title, range, fitted: false });
  }
}
