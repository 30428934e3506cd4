// Draws what stands below the disk: the colour scale, a length, and the arrow of a force. Also numbers, lines, arrows.

export const FONT = "12px system-ui, sans-serif";
export const ARROW = 0.35; // length of the arrow of the full force [R]
const FRINGES = 5; // number of fringes in their scale
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
function roundBelow(value) {
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
  Object.assign(ctx, { strokeStyle: colour, lineWidth: thickness });
  ctx.setLineDash(dash);
  ctx.stroke();
}

// Draw an arrow between two points [px], with a rim that sets it off against the disk.
export function arrow(ctx, [x0, y0], [x1, y1], thickness, colour, rim) {
  const length = Math.hypot(x1 - x0, y1 - y0),
    wing = Math.min(4 * thickness, 0.4 * length) / length;
  if (length < 2 * thickness + 4) return;
  const end = (side) => [
    x1 - wing * (x1 - x0 + side * (y1 - y0)),
    y1 - wing * (y1 - y0 - side * (x1 - x0)),
  ];
  for (const [ink, wide] of [
    [rim, thickness + 2],
    [colour, thickness],
  ]) {
    line(
      ctx,
      [
        [x0, y0],
        [x1, y1],
      ],
      ink,
      wide,
    );
    line(ctx, [end(0.6), [x1, y1], end(-0.6)], ink, wide);
    ctx.fillStyle = ink;
    ctx.fill();
  }
}

const isNarrow = (width) => width < 720;
export const footer = (width) => (isNarrow(width) ? 94 : 66); // height [px]

// `scale`: pixels per R; `force`: force of an arrow of the length ARROW, 0 for none [Mc²/R]; `colours`: 256 x 3 bytes.
export function drawLegend(ctx, { width, height, theme, quantity, limit, colours, scale, force }) {
  const left = 16,
    right = width - 16,
    longest = Math.min(width, 700);
  const names = height - 10,
    numbers = names - 18,
    bar = numbers - 24,
    row = isNarrow(width) ? bar - 28 : bar + 5;
  Object.assign(ctx, { font: FONT, fillStyle: theme.ground });
  ctx.fillRect(0, height - footer(width), width, footer(width));
  const write = (text, x, y, textAlign = "center") => {
    Object.assign(ctx, { textAlign, fillStyle: theme.faint });
    ctx.fillText(text, x, y);
  };

  const length = roundBelow((0.2 * longest) / scale),
    start = right - length * scale;
  line(
    ctx,
    [
      [start, row],
      [right, row],
    ],
    theme.ink,
    1.6,
  );
  for (const end of [start, right])
    line(
      ctx,
      [
        [end, row - 4],
        [end, row + 4],
      ],
      theme.ink,
      1.6,
    );
  write(length === 1 ? "R" : `${label(length)} R`, start - 8, row + 4, "right");
  if (force) {
    const pixels = (ARROW * scale) / force,
      shown = roundBelow((0.1 * longest) / pixels),
      tip = left + shown * pixels;
    arrow(ctx, [left, row], [tip, row], 1.6, theme.ink, theme.ground);
    write(`wall: ${label(shown)} Mc²/R`, tip + 8, row + 4, "left");
  }

  const fringes = quantity.name === "fringes",
    { signed } = quantity;
  const wide = Math.round(Math.min(300, width - 64)),
    from = Math.round((width - wide) / 2);
  for (let k = 0; k < wide; k++) {
    const part = (k + 0.5) / wide,
      level = fringes ? Math.sin(Math.PI * FRINGES * part) ** 2 : part;
    ctx.fillStyle = `rgb(${colours.subarray(3 * Math.round(255 * level)).subarray(0, 3)})`;
    ctx.fillRect(from + k, bar, 1.5, 10);
  }
  const percent = quantity.name === "strain" ? 100 : 1,
    count = fringes ? FRINGES : 2; // ticks on either side of 0
  for (let k = signed ? -count : 0; k <= count; k++) {
    const part = k / count,
      x = from + wide * (signed ? (1 + part) / 2 : part);
    line(
      ctx,
      [
        [x, bar + 10],
        [x, bar + 14],
      ],
      theme.faint,
      1,
    );
    const bound = part === 1 ? "≥ " : part === -1 ? "≤ " : "";
    if (!fringes)
      write(bound + label(percent * part * limit, signed) + (percent > 1 ? " %" : ""), x, numbers);
  }
  const unit = quantity.unit ? `  [${quantity.unit}]` : "";
  const name = fringes
    ? `fringes of the shear stress, one for ${label(limit)} Mc²/R²`
    : quantity.label + unit;
  const whole = `◂ ${quantity.low}    ${name}    ${quantity.high} ▸`;
  write(quantity.low && ctx.measureText(whole).width < width - 32 ? whole : name, width / 2, names);
}
