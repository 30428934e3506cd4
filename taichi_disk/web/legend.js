// What stands below the disk: the colour scale, a length, and the arrow of the wall's force. Numbers and arrows.

export const FONT = "12px system-ui, sans-serif";
export const ARROW = 0.35; // length of the arrow of the full force [R]
const FRINGES = 5; // in a scale of fringes
const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

// A number as +5, 0.02 or 2·10⁻⁷.
export function label(value, signed = false) {
  const small = value && Math.abs(value) < 1e-3;
  const [digits, power] = (small ? value.toExponential(3) : value.toPrecision(4)).split("e");
  const raised = String(Number(power)).replace(/\d/g, (digit) => RAISED[digit]).replace("-", "⁻");
  const text = String(Number(digits)).replace("-", "−") + (power ? `·10${raised}` : "");
  return signed && value > 0 ? `+${text}` : text;
}

// The largest of 1, 2 and 5 times a power of ten up to a value > 0.
export function roundBelow(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return decade * [5, 2, 1].find((step) => step <= (value / decade) * (1 + 1e-9));
}

export function roundAbove(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return decade * [1, 1.5, 2, 3, 5, 7, 10].find((step) => step >= (value / decade) * (1 - 1e-9));
}

export function line(ctx, points, colour, thickness, dash = []) {
  ctx.beginPath();
  for (const point of points) ctx.lineTo(...point);
  ctx.strokeStyle = colour;
  ctx.lineWidth = thickness;
  ctx.setLineDash(dash);
  ctx.stroke();
  ctx.setLineDash([]);
}

// An arrow between two points [px], with a rim that sets it off against the disk.
export function arrow(ctx, [x0, y0], [x1, y1], thickness, colour, rim) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  if (!length) return;
  const wing = Math.min(2.7 * thickness, 0.3 * length), neck = length - 2 * wing, half = thickness / 2;
  const path = new Path2D(), ux = (x1 - x0) / length, uy = (y1 - y0) / length;
  const upper = [[0, half], [neck, half], [neck, wing]], lower = [[neck, -wing], [neck, -half], [0, -half]];
  for (const [along, across] of [...upper, [length, 0], ...lower]) {
    path.lineTo(x0 + along * ux - across * uy, y0 + along * uy + across * ux);
  }
  path.closePath();
  Object.assign(ctx, { strokeStyle: rim, fillStyle: colour, lineWidth: 2 });
  ctx.stroke(path);
  ctx.fill(path);
}

const isNarrow = (width) => width < 560;
export const footer = (width) => (isNarrow(width) ? 96 : 66); // height [px]

// `scale`: pixels per R; `force`: of an arrow ARROW long, 0 for none [Mc²/R]; `colours`: 256 x 3 bytes.
export function drawLegend(ctx, { width, height, theme, quantity, limit, colours, scale, force }) {
  const narrow = isNarrow(width), left = 16, right = width - 16, longest = Math.min(width, 700);
  const names = height - 10, numbers = names - 18, bar = numbers - 24, row = narrow ? bar - 28 : bar + 5;
  ctx.font = FONT;
  ctx.fillStyle = theme.ground;
  ctx.fillRect(0, height - footer(width), width, footer(width));
  const write = (text, x, y, align = "center") => {
    Object.assign(ctx, { textAlign: align, fillStyle: theme.faint });
    ctx.fillText(text, x, y);
  };

  const length = roundBelow((0.2 * longest) / scale), start = right - length * scale;
  line(ctx, [[start, row], [right, row]], theme.ink, 1.6);
  for (const end of [start, right]) line(ctx, [[end, row - 4], [end, row + 4]], theme.ink, 1.6);
  const size = length === 1 ? "R" : `${label(length)} R`;
  if (narrow) write(size, start - 8, row + 4, "right");
  else write(size, Math.min((start + right) / 2, right - ctx.measureText(size).width / 2), numbers);
  if (force) {
    const pixels = (ARROW * scale) / force, shown = roundBelow((0.1 * longest) / pixels), tip = left + shown * pixels;
    arrow(ctx, [left, row], [tip, row], 1.6, theme.ink, theme.ground);
    if (narrow) write(`wall: ${label(shown)} Mc²/R`, tip + 8, row + 4, "left");
    else write(`${label(shown)} Mc²/R`, left, numbers, "left");
    if (width > 860) write("wall force on one point", left, names, "left");
  }

  const fringes = quantity.name === "fringes";
  const highest = fringes ? FRINGES : limit, lowest = quantity.signed ? -highest : 0;
  const wide = Math.round(narrow ? width - 64 : Math.min(300, width - 360)), from = Math.round((width - wide) / 2);
  for (let k = 0; k < wide; k++) {
    const part = (k + 0.5) / wide, level = fringes ? Math.sin(Math.PI * FRINGES * part) ** 2 : part;
    ctx.fillStyle = `rgb(${colours.subarray(3 * Math.round(255 * level)).subarray(0, 3)})`;
    ctx.fillRect(from + k, bar, 1.5, 10);
  }
  const count = fringes ? FRINGES : /^(1\.5|[36])/.test(highest.toExponential()) ? 3 : 2; // ticks on either side of 0
  const percent = quantity.name === "strain" ? 100 : 1;
  for (let k = quantity.signed ? -count : 0; k <= count; k++) {
    const tick = (k / count) * highest, x = from + (wide * (tick - lowest)) / (highest - lowest);
    line(ctx, [[x, bar + 10], [x, bar + 14]], theme.faint, 1);
    if (count === 3 && quantity.signed && k % 3) continue; // there is no room
    const bound = fringes ? "" : k === count ? "≥ " : k === -count ? "≤ " : "";
    write(bound + label(percent * tick, quantity.signed) + (percent > 1 ? " %" : ""), x, numbers);
  }
  const unit = quantity.unit ? `  [${quantity.unit}]` : "";
  const name = fringes ? `fringes of the shear stress, one for ${label(limit)} Mc²/R²` : quantity.label + unit;
  const whole = `◂ ${quantity.low}    ${name}    ${quantity.high} ▸`;
  const fits = quantity.low && ctx.measureText(whole).width < (narrow ? width : wide + 120);
  write(fits ? whole : name, width / 2, names);
}
