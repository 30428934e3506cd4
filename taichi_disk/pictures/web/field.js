// Draws triangles, springs and points on the processor, into an image with the canvas's pixels.
// It needs no graphics driver, and was faster than WebGL by software in every case measured.

const LEVELS = 1024; // of the table of colours; a power of two, so that fringes can wrap
const OPAQUE = 255 << 24;

// Return colours as the image stores them, for LEVELS values from 0 to 1; `map`: 256 x 3 bytes.
function table(map, fringes) {
  const colours = new Int32Array(LEVELS);
  for (let k = 0; k < LEVELS; k++) {
    const part = fringes ? Math.sin((Math.PI * (k + 0.5)) / LEVELS) ** 2 : k / (LEVELS - 1);
    const place = 3 * Math.round(255 * part);
    colours[k] = OPAQUE | (map[place + 2] << 16) | (map[place + 1] << 8) | map[place];
  }
  return colours;
}

// Return an opaque pixel with `part` of 256 parts of a colour over another; in whole numbers, red
// and blue at once, because this is done most often.
function mixed(below, colour, part) {
  const rest = 256 - part;
  const sides = Math.imul(colour & 0xff00ff, part) + Math.imul(below & 0xff00ff, rest);
  const green = Math.imul(colour & 0xff00, part) + Math.imul(below & 0xff00, rest);
  return OPAQUE | ((sides >>> 8) & 0xff00ff) | ((green >>> 8) & 0xff00);
}

export class Field {
  constructor({ points, triangles, springs }) {
    this.canvas = document.createElement("canvas");
    // Keep the canvas in the processor's memory, where the image is.
    this.context = this.canvas.getContext("2d", { willReadFrequently: true });
    Object.assign(this, { triangles, springs });
    this.places = new Float32Array(2 * points); // [px], y downwards
    this.levels = new Float32Array(points + springs.length / 2); // in the table of colours
  }

  // positions (2n) [R]; values (n), or one for each spring; marks: what to draw, in order, as
  // {mark: "triangles", "springs" or "points"; radius [px]; ink: opacity of black instead of a
  // colour}; colours: 256 x 3 bytes; factor: pixels per R; shift: the origin [px], y upwards;
  // scale: factor and shift from a value to its place in the colour map; fringes: whether the
  // colours repeat.
  draw(width, height, { positions, values, marks, colours, factor, shift, scale, fringes }) {
    if (this.image?.width !== width || this.image.height !== height) {
      Object.assign(this.canvas, { width, height });
      this.image = this.context.createImageData(width, height);
      this.pixels = new Int32Array(this.image.data.buffer);
    }
    Object.assign(this, { width, height, fringes });
    this.pixels.fill(0);
    this.table = table(colours, fringes);
    for (let i = 0; i < this.places.length; i += 2) {
      this.places[i] = shift[0] + factor * positions[i];
      this.places[i + 1] = height - shift[1] - factor * positions[i + 1];
    }
    const last = fringes ? LEVELS : LEVELS - 1;
    for (let i = 0; i < values.length; i++) {
      this.levels[i] = last * (scale[0] * values[i] + scale[1]);
    }
    const ofSprings = values.length !== this.places.length / 2;
    for (const { mark, radius = 0, ink = 0 } of marks) {
      if (mark === "triangles") this.fillTriangles();
      else if (mark === "springs") this.drawSprings(radius, ink, ofSprings);
      else this.drawPoints(radius);
    }
    this.context.putImageData(this.image, 0, 0);
    return this.canvas;
  }

  colour(level) {
    if (this.fringes) return this.table[Math.floor(level) & (LEVELS - 1)];
    return this.table[Math.min(Math.max(Math.round(level), 0), LEVELS - 1)];
  }

  fillTriangles() {
    const { places, triangles } = this;
    const isLower = (one, other) => places[2 * one + 1] > places[2 * other + 1];
    for (let k = 0; k < triangles.length; k += 3) {
      // The corners from top to bottom: neighbours then find the same pixels on a common side.
      let top = triangles[k];
      let middle = triangles[k + 1];
      let bottom = triangles[k + 2];
      if (isLower(top, middle)) [top, middle] = [middle, top];
      if (isLower(middle, bottom)) [middle, bottom] = [bottom, middle];
      if (isLower(top, middle)) [top, middle] = [middle, top];
      this.fillTriangle(top, middle, bottom);
    }
  }

  // Fill the pixels whose middle is in a triangle, with values interpolated between its corners.
  fillTriangle(a, b, c) {
    const { places, levels, pixels, width, height, fringes } = this;
    const colours = this.table;
    const ax = places[2 * a];
    const ay = places[2 * a + 1];
    const bx = places[2 * b] - ax;
    const by = places[2 * b + 1] - ay;
    const cx = places[2 * c] - ax;
    const cy = places[2 * c + 1] - ay;
    const area = bx * cy - cx * by;
    if (!area) return;
    const level = levels[a];
    const bLevel = levels[b] - level;
    const cLevel = levels[c] - level;
    const slopeX = (bLevel * cy - cLevel * by) / area;
    const slopeY = (cLevel * bx - bLevel * cx) / area;
    const firstRow = Math.max(Math.ceil(ay - 0.5), 0);
    const endRow = Math.min(Math.ceil(ay + cy - 0.5), height);
    for (let row = firstRow; row < endRow; row++) {
      const dy = row + 0.5 - ay;
      const long = (cx * dy) / cy;
      const short = dy < by ? (bx * dy) / by : bx + ((cx - bx) * (dy - by)) / (cy - by);
      const first = Math.max(Math.ceil(ax + Math.min(long, short) - 0.5), 0);
      const end = Math.min(Math.ceil(ax + Math.max(long, short) - 0.5), width);
      let value = level + slopeY * dy + slopeX * (first + 0.5 - ax);
      const stop = row * width + end;
      for (let at = row * width + first; at < stop; at++) {
        let place = fringes ? Math.floor(value) & (LEVELS - 1) : (value + 0.5) | 0;
        if (place < 0) place = 0;
        else if (place >= LEVELS) place = LEVELS - 1;
        pixels[at] = colours[place];
        value += slopeX;
      }
    }
  }

  // A spring has its own value, or the mean of its ends.
  drawSprings(radius, ink, ofSprings) {
    const { places, levels, springs, width, height } = this;
    const alongX = { ahead: 1, beside: width, length: width, breadth: height };
    const alongY = { ahead: width, beside: 1, length: height, breadth: width };
    for (let k = 0; k < springs.length; k += 2) {
      const a = springs[k];
      const b = springs[k + 1];
      const level = ofSprings ? levels[k / 2] : 0.5 * (levels[a] + levels[b]);
      const brush = { radius, opacity: ink || 1, colour: ink ? OPAQUE : this.colour(level) };
      const x = places[2 * a];
      const y = places[2 * a + 1];
      const dx = places[2 * b] - x;
      const dy = places[2 * b + 1] - y;
      if (Math.abs(dx) > Math.abs(dy)) this.drawLine(alongX, brush, x, y, dx, dy / dx);
      else if (dy) this.drawLine(alongY, brush, y, x, dy, dx / dy);
    }
  }

  // Draw a line with soft sides. Its first coordinate is along the axis to which it is closer:
  // it begins at (x, y), goes as far as `dx`, and rises by `slope`.
  drawLine({ ahead, beside, length, breadth }, { radius, opacity, colour }, x, y, dx, slope) {
    const slant = 1 / Math.sqrt(1 + slope * slope);
    const reach = (radius + 0.5) / slant;
    const first = Math.max(Math.ceil(Math.min(x, x + dx) - 0.5), 0);
    const end = Math.min(Math.ceil(Math.max(x, x + dx) - 0.5), length);
    for (let column = first; column < end; column++) {
      const centre = y + slope * (column + 0.5 - x) - 0.5;
      const low = Math.max(Math.ceil(centre - reach), 0);
      const high = Math.min(Math.floor(centre + reach), breadth - 1);
      for (let row = low; row <= high; row++) {
        const covered = Math.min(radius + 0.5 - Math.abs(row - centre) * slant, 1);
        this.blend(column * ahead + row * beside, colour, opacity * covered);
      }
    }
  }

  drawPoints(radius) {
    const { places, levels, width, height } = this;
    const reach = radius + 0.5;
    for (let i = 0; i < places.length / 2; i++) {
      const x = places[2 * i] - 0.5;
      const y = places[2 * i + 1] - 0.5;
      const colour = this.colour(levels[i]);
      const right = Math.min(Math.floor(x + reach), width - 1);
      const bottom = Math.min(Math.floor(y + reach), height - 1);
      for (let row = Math.max(Math.ceil(y - reach), 0); row <= bottom; row++) {
        for (let column = Math.max(Math.ceil(x - reach), 0); column <= right; column++) {
          const distance = Math.sqrt((column - x) ** 2 + (row - y) ** 2);
          const covered = Math.min(reach - distance, 1);
          if (covered > 0) this.blend(row * width + column, colour, covered);
        }
      }
    }
  }

  // Put a colour with an opacity over a pixel.
  blend(at, colour, opacity) {
    const { pixels } = this;
    const below = pixels[at];
    const alpha = below >>> 24;
    if (alpha === 255) {
      pixels[at] = mixed(below, colour, (256 * opacity + 0.5) | 0);
      return;
    }
    const sum = opacity * 255 + alpha * (1 - opacity);
    const part = (255 * opacity) / sum;
    const red = (below & 255) + part * ((colour & 255) - (below & 255));
    const green = ((below >> 8) & 255) + part * (((colour >> 8) & 255) - ((below >> 8) & 255));
    const blue = ((below >> 16) & 255) + part * (((colour >> 16) & 255) - ((below >> 16) & 255));
    pixels[at] = ((sum + 0.5) << 24) | ((blue + 0.5) << 16) | ((green + 0.5) << 8) | (red + 0.5);
  }
}
