// What mouse and fingers do on the disk: turn, aim, pull; move the picture, bring it closer.

import { AIM } from "./draw.js";

const NEAR = 24; // distance from the arrow's tip at which it is taken hold of [px]

export class Gestures {
  // `sandbox` has the drawing, the last state, the panel and `send`.
  constructor(canvas, sandbox) {
    Object.assign(this, { canvas, sandbox, doing: null, pointers: new Map(), target: null });
    canvas.onpointerdown = (event) => this.press(event);
    canvas.onpointermove = (event) => this.move(event);
    canvas.onpointerup = canvas.onpointercancel = (event) => this.release(event);
    canvas.oncontextmenu = (event) => event.preventDefault();
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.sandbox.drawing.zoom(1.12 ** (-event.deltaY / 60), event.offsetX, event.offsetY);
      this.sandbox.redraw();
    }, { passive: false });
  }

  get centre() {
    const { com_x, com_y } = this.sandbox.state.row;
    return [com_x, com_y];
  }

  press(event) {
    const { drawing, state, panel, plays } = this.sandbox, at = [event.offsetX, event.offsetY];
    if (!state || !panel) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, at);
    if (this.pointers.size > 1) {
      this.end(true);
      this.doing = "pinch";
    } else if (event.button > 0 || event.shiftKey || !plays) {
      this.doing = "pan";
    } else {
      const point = drawing.toWorld(...at), [cx, cy] = this.centre, { com_vx, com_vy } = state.row;
      const tip = drawing.toScreen(cx + com_vx / AIM, cy + com_vy / AIM), throwing = panel.atStart && panel.isImpact;
      let radius = 0;
      const { x } = state, n = 2 * drawing.scene.disk_points;
      for (let k = 0; k < n; k += 2) radius = Math.max(radius, Math.hypot(x[k] - cx, x[k + 1] - cy));
      if (throwing && this.sandbox.shows("arrow") && Math.hypot(tip[0] - at[0], tip[1] - at[1]) < NEAR) {
        [this.doing, this.from] = ["aim", [cx, cy]];
      } else if (throwing && Math.hypot(point[0] - cx, point[1] - cy) > radius) {
        [this.doing, this.from] = ["aim", point];
      } else if (throwing) {
        [this.doing, this.from, this.turned] = ["turn", Math.atan2(point[1] - cy, point[0] - cx), 0];
      } else {
        this.doing = "pull";
      }
      this.move(event);
    }
  }

  move(event) {
    const before = this.pointers.get(event.pointerId), at = [event.offsetX, event.offsetY], { drawing, send } = this.sandbox;
    if (!before || !this.doing) return;
    this.pointers.set(event.pointerId, at);
    const [x, y] = drawing.toWorld(...at);
    if (this.doing === "pinch") {
      const other = [...this.pointers].find(([id]) => id !== event.pointerId)?.[1];
      if (!other) return;
      const distance = (one) => Math.hypot(one[0] - other[0], one[1] - other[1]) || 1;
      drawing.zoom(distance(at) / distance(before), (at[0] + other[0]) / 2, (at[1] + other[1]) / 2);
      drawing.pan((at[0] - before[0]) / 2, (at[1] - before[1]) / 2);
    } else if (this.doing === "pan") {
      drawing.pan(at[0] - before[0], at[1] - before[1]);
    } else if (this.doing === "turn") {
      this.turned = Math.atan2(y - this.centre[1], x - this.centre[0]) - this.from;
      send({ do: "turn", angle: this.turned, final: 0 });
    } else if (this.doing === "aim" && (x !== this.from[0] || y !== this.from[1])) {
      this.aimed = true;
      send({ do: "aim", dx: x - this.from[0], dy: y - this.from[1] });
    } else if (this.doing === "pull") {
      this.target = [x, y];
      send({ do: "pull", x, y });
    }
    this.sandbox.redraw();
  }

  release(event) {
    this.pointers.delete(event.pointerId);
    if (this.doing !== "pinch") this.end(event.type === "pointercancel");
    else if (!this.pointers.size) this.doing = null;
  }

  end(cancelled) {
    const { send } = this.sandbox, { doing, turned, aimed } = this;
    Object.assign(this, { doing: null, target: null, aimed: false });
    if (doing === "turn" && turned) send({ do: "turn", angle: cancelled ? 0 : turned, final: 1 });
    if (doing === "aim" && aimed && !cancelled) send({ do: "throw" });
    if (doing === "pull" || (doing === "aim" && cancelled)) send({ do: "release" });
  }
}
