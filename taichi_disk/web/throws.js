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
// what a row of results.js has beside a throw's numbers
const ROW = { result: "e", wall: null, a: null, points: null, angle: 0, spin: 0, friction: 0 };

export class Throws {
  // `take` is called with each throw, which the film then shows
  constructor(ui, film, scene, take) {
    Object.assign(this, { ui, film, take, goal: NaN, rows: [], wanted: {} });
    this.disk = diskOf(film.again, scene);
    this.numbers = film.again.numbers;
    for (const { key, value } of this.numbers) this.wanted[key] = value;
    this.sliders = new Controls(
      () => ui.numbers,
      (key, value) => {
        this.want({ [key]: value });
        ui.told.textContent = "";
      },
      (text) => (ui.told.textContent = text),
    );
    ui.throws.hidden = ui.list.hidden = false;
    document.querySelector("main").classList.add("throws");
    ui.throw.onclick = () => {
      this.throw();
      if (location.protocol !== "about:") history.replaceState(null, "", this.link(this.wanted));
    };
    ui.link.onclick = () => this.say(copy(this.address), "Copied: open it anywhere, or send it.");
    ui.copy.onclick = () => this.say(copy(asText(ui.table, "\t")), "The table is copied.");
    ui.addresses.onchange = () => this.collect();
    ui.list.ontoggle = () => this.showList();
    window.onhashchange = () => this.obey();
    this.obey();
  }

  async say(done, text) {
    await done;
    this.ui.told.textContent = text;
  }

  // Take numbers, as far as the sliders go.
  want(numbers) {
    for (const { key, low, high } of this.numbers) {
      const value = numbers[key];
      if (Number.isFinite(value)) this.wanted[key] = Math.min(Math.max(value, low), high);
    }
    const live = { meaning: "of the throw", live: true };
    this.sliders.show(this.numbers.map((one) => ({ ...one, ...live, value: this.wanted[one.key] })));
  }

  // Return the numbers in an address.
  read(address) {
    const words = new URLSearchParams(address.slice(address.indexOf("#") + 1));
    return Object.fromEntries([...words].map(([key, text]) => [key, text ? Number(text) : NaN]));
  }

  // Return the end of the address of a throw.
  link({ v, eta }) {
    return `#${new URLSearchParams(this.goal ? { v, eta, goal: this.goal } : { v, eta })}`;
  }

  get address() {
    const here = location.protocol === "about:" ? "" : location.href.split("#")[0];
    return here + this.link(this.wanted);
  }

  obey() {
    const said = this.read(location.hash);
    this.goal = said.goal > 0 && said.goal <= 1 ? said.goal : NaN;
    this.want(said);
    this.throw();
  }

  // Return the throw with these numbers, and write it into the table.
  thrown({ v, eta }) {
    const one = new Again(this.disk, this.film, v, eta);
    const { flight, moments } = one;
    const contact_time = moments[2] - moments[0];
    const row = { ...ROW, load: v, eta_star: eta, value: flight.restitution, contact_time };
    const isKnown = this.rows.some((old) => old.load === v && old.eta_star === eta);
    if (!isKnown) this.rows.push(row);
    return one;
  }

  throw() {
    const { ui, wanted } = this;
    try {
      const one = this.thrown(wanted);
      this.take(one);
      this.tell(one);
    } catch (error) {
      ui.told.textContent = error.message;
    }
  }

  // Say what the throw on display has needed, and what is wrong with it.
  tell({ flight, folded, duration }) {
    const steps = Math.round(flight.rows[flight.end].t / flight.dt);
    const work = `${steps.toLocaleString("en")} steps in ${Math.round(duration)} ms`;
    const exact = `e = ${flight.restitution.toFixed(10)}, as run with velocity_verlet`;
    const warning = `${folded} triangles turned inside out: this e is meaningless. Throw slower.`;
    this.ui.told.textContent = folded ? warning : `${work}: ${exact}`;
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
    const lines = ui.addresses.value.split("\n").filter((line) => line.trim());
    const faults = [];
    for (const line of lines) {
      const said = this.read(line.trim());
      const isThrow = numbers.every(({ key, low, high }) => said[key] >= low && said[key] <= high);
      try {
        if (!isThrow) throw new Error("no address of a throw of this disk");
        this.thrown(said);
      } catch (error) {
        faults.push(`${line.trim().slice(0, 60)}: ${error.message}`);
      }
      await new Promise((done) => setTimeout(done));
      this.showList();
    }
    ui.addresses.value = "";
    ui.faults.textContent = faults.join("\n");
  }

  showList() {
    const { ui, rows, numbers } = this;
    if (!ui.list.open) return;
    showResults(ui.table, rows, false);
    const [{ low, high }] = numbers;
    const title = "restitution e over the speed v [c]";
    showDiagram(ui.diagram, ui.curve, rows, { title, range: [low, high], fitted: false });
  }
}
