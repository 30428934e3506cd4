// The list of scenes, with a small picture of each.

import { element } from "./html.js";
import { arrow, line } from "./legend.js";

// Draw a scene before it begins: the wall, the disk, its throw or its load, and its spin.
function sketch(card) {
  const canvas = element("canvas", { width: 128, height: 96, ariaHidden: true });
  const ctx = canvas.getContext("2d");
  const ink = "#8a8d94";
  const velocity = "#1d9c7f";
  const isImpact = card.kind !== "compression";
  const wall = 78;
  const x = 64 - 16 * Math.sign(card.angle);
  const y = isImpact ? wall - 38 : wall - 30;
  const isElastic = card.kind === "absorbing_wall";
  ctx.fillStyle = ink;
  ctx.globalAlpha = isElastic ? 0.35 : 0.6;
  if (isElastic) {
    ctx.beginPath();
    ctx.arc(64, wall, 56, 0, Math.PI);
    ctx.fill();
  } else ctx.fillRect(0, wall, 128, card.a > 1000 ? 18 : 10);
  ctx.globalAlpha = 1;
  const pens = {
    pinned: { strokeStyle: ink, lineWidth: 4 },
    dashpot: { strokeStyle: "#3f8fd0", lineWidth: 3 },
    reset: { strokeStyle: ink, lineWidth: 1 },
  };
  const pen = pens[card.boundary];
  if (pen) {
    Object.assign(ctx, pen);
    ctx.beginPath();
    ctx.arc(64, wall, 55, 0.1, Math.PI - 0.1);
    ctx.stroke();
  }
  Object.assign(ctx, { fillStyle: "#f2c078", strokeStyle: ink, lineWidth: 2 });
  const path = new Path2D(card.outline?.match(/ d="([^"]*)"/)[1]);
  if (card.outline) {
    ctx.setTransform(25, 0, 0, 25, x, y);
    ctx.lineWidth /= 25;
  } else path.arc(x, y, 30, 0, 2 * Math.PI);
  ctx.fill(path, "evenodd");
  ctx.stroke(path);
  ctx.setTransform(1, 0, 0, 1, 0, 0);
  const angle = -Math.PI / 2 - card.turn;
  const mark = [x + 28 * Math.cos(angle), y + 28 * Math.sin(angle)];
  line(ctx, [mark, [x, y]], ink, 2);
  if (card.spin) turnArrow(ctx, x, y, Math.sign(card.spin), velocity);
  const length = 8 + (isImpact ? 90 * Math.sqrt(card.velocity) : 140 * Math.sqrt(card.pressure));
  const foot = isImpact ? y : y - 8 - length;
  const tip = [x + length * Math.sin(card.angle), foot + length * Math.cos(card.angle)];
  arrow(ctx, [x, foot], tip, 3, isImpact ? velocity : ink, "#fff");
  return canvas;
}

// Draw an arrow around a disk, counter-clockwise for a `sense` of 1.
function turnArrow(ctx, x, y, sense, colour) {
  const place = (angle, radius) => [
    x + radius * Math.cos(angle),
    y - sense * radius * Math.sin(angle),
  ];
  const arc = Array.from({ length: 12 }, (_, k) => place(0.5 + 0.16 * k, 38));
  line(ctx, arc, colour, 2.5);
  line(ctx, [place(2.05, 44), place(2.4, 38), place(2.05, 31)], colour, 2.5);
}

export function showScenes(parent, playlist, number) {
  const parts = [];
  let group = "";
  let cards = null;
  playlist.forEach((card, k) => {
    if (!cards || card.group !== group) {
      group = card.group;
      cards = element("div", { className: "cards" });
      if (group) parts.push(element("h3", {}, group));
      parts.push(cards);
    }
    const words = element("span", {}, element("b", {}, card.name), element("small", {}, card.question));
    const entry = element("button", { ariaCurrent: k === number }, words);
    if (card.kind) entry.prepend(sketch(card));
    entry.dataset.play = k;
    cards.append(entry);
  });
  parent.replaceChildren(...parts);
}
