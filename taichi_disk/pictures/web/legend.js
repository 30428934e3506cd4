// Draws what stands below the disk: the colour scale, a length, and the arrow of a force. Also
// numbers, lines and arrows.

export const FONT = "12px system-ui, sans-serif";
export const ARROW = 0.35; // length of the arrow of the full force [R]
export const FRINGES = 5; // number of fringes in their scale
const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

// Return a number as +5, 0.02 or 2·10⁻⁷.
export function label(value, signed = false) {
  const small = value && Math.abs(value) < 1e-3;
  const [digits, power] = (small ? value.toExponential(3) : value.toPrecision(4)).split("e");
  const raised = String(Number(power))
    .replace(/\d/g, (digit) => RAISED[digit])
    .replace("-", "⁻");
  const text = String(Number(digits)).replace("-", "−") + (power ? `·10${raised}` : "");
  return signed && value > 0 ? `+${text}` : text;
}

// Return the largest of 1, 2 and 5 times a power of ten up to a value > 0.
export function roundBelow(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return decade * [5, 2, 1].find((step) => step <= (value / decade) * (1 + 1e-9));
}

export function roundAbove(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return decade * [1, 1.5, 2, 3, 5, 7, 10].find((step) => step >= (value / decade) * (1 - 1e-9));
}

// Draw a line through points [px]: lists of two numbers.
export function line(ctx, points, colour, thickness, dash = []) {
  ctx.beginPath();
  for (const point of points) ctx.lineTo(...point);
  Object.assign(ctx, { strokeStyle: colour, lineWidth: thickness });
  ctx.setLineDash(dash);
  ctx.stroke();
}

// Draw an arrow between two points [px], with a rim that sets it off against the disk.
export function arrow(ctx, foot, tip, thickness, colour, rim) {
  const dx = tip[0] - foot[0];
  const dy = tip[1] - foot[1];
  const length = Math.hypot(dx, dy);
  if (length < 2 * thickness + 4) return;
  const wing = Math.min(4 * thickness, 0.4 * length) / length;
  const end = (side) => [tip[0] - wing * (dx + side * dy), tip[1] - wing * (dy - side * dx)];
  const head = [end(0.6), tip, end(-0.6)];
  for (const [ink, width] of [[rim, thickness + 2], [colour, thickness]]) {
    line(ctx, [foot, tip], ink, width);
    line(ctx, head, ink, width);
    ctx.fillStyle = ink;
    ctx.fill();
  }
}

// Return where things stand below the disk, for a picture of this size [px]: the height of all;
// above the lower edge the colour scale, its numbers, its name, and the row of length and force;
// and the width beside the colour scale.
function layout(width, height) {
  const isWide = width > 560;
  const high = { bar: 52, numbers: 28, name: 10 };
  const low = { bar: 56, numbers: 32, name: 10 };
  if (width >= 720) return { height: 66, ...high, row: 47, beside: 460, hasKeys: true };
  if (height >= 400) return { height: 94, ...high, row: 80, beside: 64, hasKeys: true };
  return { height: 62, ...low, row: 51, beside: isWide ? 460 : 64, hasKeys: isWide };
}

export const footer = (width, height) => layout(width, height).height;

// `scale`: pixels per R; `force`: force of an arrow of the length ARROW, 0 for none [Mc²/R];
// `colours`: 256 x 3 bytes.
export function drawLegend(ctx, picture) {
  const { width, height, theme } = picture;
  const places = layout(width, height);
  Object.assign(ctx, { font: FONT, fillStyle: theme.ground });
  ctx.fillRect(0, height - places.height, width, places.height);
  if (places.hasKeys) drawKeys(ctx, picture, height - places.row);
  drawColours(ctx, picture, places);
}

export function write(ctx, text, x, y, { textAlign = "center", theme }) {
  Object.assign(ctx, { textAlign, fillStyle: theme.faint });
  ctx.fillText(text, x, y);
}

// Draw a length, and the arrow of a force.
function drawKeys(ctx, { width, theme, scale, force }, row) {
  const longest = Math.min(width, 700);
  const right = width - 16;
  const length = roundBelow((0.2 * longest) / scale);
  const start = right - length * scale;
  const rule = (from, to) => line(ctx, [from, to], theme.ink, 1.6);
  rule([start, row], [right, row]);
  for (const end of [start, right]) rule([end, row - 4], [end, row + 4]);
  const text = length === 1 ? "R" : `${label(length)} R`;
  write(ctx, text, start - 8, row + 4, { textAlign: "right", theme });
  if (!force) return;
  const left = 16;
  const pixels = (ARROW * scale) / force;
  const shown = roundBelow((0.1 * longest) / pixels);
  const tip = left + shown * pixels;
  arrow(ctx, [left, row], [tip, row], 1.6, theme.ink, theme.ground);
  write(ctx, `${label(shown)} Mc²/R on a point`, tip + 8, row + 4, { textAlign: "left", theme });
}

// Draw the scale of colours with its numbers and its name.
function drawColours(ctx, { width, height, theme, quantity, limit, colours }, places) {
  const isFringes = quantity.name === "fringes";
  const wide = Math.round(Math.min(300, width - places.beside));
  const left = Math.round((width - wide) / 2);
  const bar = height - places.bar;
  for (let k = 0; k < wide; k++) {
    const part = (k + 0.5) / wide;
    const level = isFringes ? Math.sin(Math.PI * FRINGES * part) ** 2 : part;
    const at = 3 * Math.round(255 * level);
    ctx.fillStyle = `rgb(${colours.subarray(at, at + 3)})`;
    ctx.fillRect(left + k, bar, 1.5, 10);
  }
  const percent = quantity.name === "strain" ? 100 : 1;
  const count = isFringes ? FRINGES : 2; // ticks on either side of 0
  for (let k = quantity.signed ? -count : 0; k <= count; k++) {
    const part = k / count;
    const x = left + wide * (quantity.signed ? (1 + part) / 2 : part);
    const top = [x, bar + 10];
    const bottom = [x, bar + 14];
    line(ctx, [top, bottom], theme.faint, 1);
    const bounds = { [-1]: "≤ ", 1: "≥ " };
    const number = label(percent * part * limit, quantity.signed);
    const text = (bounds[part] ?? "") + number + (percent > 1 ? " %" : "");
    if (!isFringes) write(ctx, text, x, height - places.numbers, { theme });
  }
  const name = nameOf(quantity, limit);
  const whole = `◂ ${quantity.low}    ${name}    ${quantity.high} ▸`;
  const words = [quantity.low ? whole : name, name, name.split("  [")[0]];
  const text = words.find((one) => ctx.measureText(one).width < width - 16) ?? "";
  write(ctx, text, width / 2, height - places.name, { theme });
}

function nameOf({ name, label: text, unit }, limit) {
  if (name === "fringes") return `fringes of the shear stress, one for ${label(limit)} Mc²/R²`;
  return unit ? `${text}  [${unit}]` : text;
}
