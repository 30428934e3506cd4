// What stands below the disk: the scale of colours, the length, the arrow of the wall's force.

const FONT = "12px system-ui, sans-serif";
const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";
export const FRINGES = 5; // in a scale of fringes
export const ARROW = 0.35; // length of the arrow of the full force [R]

// A number as +5, 0.02 or 2·10⁻⁷.
export function label(value, signed = false) {
  if (!value) return "0";
  let [text, power] = value.toPrecision(4).split("e");
  if (!power && Math.abs(value) < 1e-3) [text, power] = value.toExponential(3).split("e");
  text = String(Number(text));
  if (power) text += "·10" + String(Number(power)).replace(/\d/g, (d) => RAISED[d]).replace("-", "⁻");
  return (signed && value > 0 ? "+" : "") + text.replace("-", "−");
}

// The largest of 1, 2 and 5 times a power of ten up to a value > 0.
export function roundBelow(value) {
  const decade = 10 ** Math.floor(Math.log10(value));
  return decade * [5, 2, 1].find((step) => step <= (value / decade) * (1 + 1e-9));
}

export const footer = (width) => (width < 560 ? 96 : 66); // height [px]

// `scale`: pixels per R; `force`: of the arrow of the full force, 0 for none [Mc²/R]; `colours`: 256 x 3 bytes.
export function drawLegend(ctx, { width, height, theme, quantity, limit, colours, scale, force }) {
  const narrow = width < 560, margin = 16;
  const words = height - 10, numbers = words - 18, bar = numbers - 24;
  const row = narrow ? bar - 28 : bar + 5;
  ctx.save();
  ctx.font = FONT;
  ctx.fillStyle = theme.ground;
  ctx.fillRect(0, height - footer(width), width, footer(width));
  ctx.strokeStyle = ctx.fillStyle = theme.ink;
  ctx.lineWidth = 1.6;

  const line = (from, to) => {
    ctx.beginPath();
    ctx.moveTo(...from);
    ctx.lineTo(...to);
    ctx.stroke();
  };
  const write = (text, x, y, align = "center") => {
    ctx.textAlign = align;
    ctx.fillStyle = theme.faint;
    ctx.fillText(text, x, y);
  };

  const length = roundBelow((0.2 * Math.min(width, 700)) / scale), right = width - margin;
  line([right - length * scale, row], [right, row]);
  for (const x of [right - length * scale, right]) line([x, row - 4], [x, row + 4]);
  const size = length === 1 ? "R" : `${label(length)} R`;
  if (narrow) write(size, right - length * scale - 8, row + 4, "right");
  else write(size, Math.min(right - (length * scale) / 2, right - ctx.measureText(size).width / 2), numbers);
  if (force) {
    const pixels = (ARROW * scale) / force, push = roundBelow((0.1 * Math.min(width, 700)) / pixels);
    const tip = margin + push * pixels, text = `${label(push)} Mc²/R`;
    line([margin, row], [tip - 4, row]);
    ctx.beginPath();
    ctx.fillStyle = theme.ink;
    for (const corner of [[tip - 8, row - 4], [tip - 8, row + 4], [tip, row]]) ctx.lineTo(...corner);
    ctx.fill();
    if (narrow) write(`wall: ${text}`, tip + 8, row + 4, "left");
    else write(text, margin, numbers, "left");
    if (!narrow && width > 860) write("wall force on one point", margin, words, "left");
  }

  const fringes = quantity.name === "fringes", most = fringes ? FRINGES : limit, least = quantity.signed ? -most : 0;
  const wide = Math.round(narrow ? width - 4 * margin : Math.min(300, width - 360)), left = Math.round((width - wide) / 2);
  for (let k = 0; k < wide; k++) {
    let level = (k + 0.5) / wide;
    if (fringes) level = Math.sin(Math.PI * FRINGES * level) ** 2;
    ctx.fillStyle = `rgb(${colours.subarray(3 * Math.round(255 * level), 3 * Math.round(255 * level) + 3)})`;
    ctx.fillRect(left + k, bar, 1.5, 10);
  }
  ctx.lineWidth = 1;
  ctx.strokeStyle = theme.rule;
  ctx.strokeRect(left - 0.5, bar - 0.5, wide + 1, 11);
  const count = fringes ? FRINGES : /^(1\.5|[36])/.test(most.toExponential()) ? 3 : 2;
  const percent = quantity.name === "strain" ? 100 : 1;
  const ticks = Array.from({ length: count * (quantity.signed ? 2 : 1) + 1 }, (_, k) => least + (k * most) / count);
  ctx.strokeStyle = theme.faint;
  ticks.forEach((tick, k) => {
    const x = left + (wide * (tick - least)) / (most - least), last = k === ticks.length - 1;
    line([x, bar + 10], [x, bar + 14]);
    if (ticks.length > 5 && !fringes && k && !last && k !== count) return;
    const bound = fringes ? "" : last ? "≥ " : k === 0 && quantity.signed ? "≤ " : "";
    write(bound + label(Math.abs(tick) < 1e-9 * most ? 0 : percent * tick, quantity.signed) + (percent > 1 ? " %" : ""), x, numbers);
  });
  const unit = quantity.unit && !fringes ? `  [${quantity.unit}]` : "";
  const name = fringes ? `fringes of the shear stress, one for ${label(limit)} Mc²/R²` : quantity.label + unit;
  const whole = `◂ ${quantity.low}    ${name}    ${quantity.high} ▸`;
  write(quantity.low && ctx.measureText(whole).width < (narrow ? width : wide + 120) ? whole : name, width / 2, words);
  ctx.restore();
}
