// Firefox records WebM films with an empty duration, so players have no time line; Chromium writes
// the duration itself.

const INFO = [0x15, 0x49, 0xa9, 0x66]; // element that describes the film (Matroska, RFC 9559)
const DURATION = [0x44, 0x89, 0x88]; // a number of 8 bytes in it [ms]
const START = 4096; // bytes in which both lie

function find(bytes, pattern, from = 0) {
  for (let i = from; i <= bytes.length - pattern.length; i++) {
    if (pattern.every((byte, k) => bytes[i + k] === byte)) return i;
  }
  return -1;
}

// Return a recorded film with its duration; a film that needs none as it is.
export async function withDuration(film, milliseconds) {
  const start = new Uint8Array(await film.slice(0, START).arrayBuffer());
  const info = find(start, INFO);
  const duration = info < 0 ? -1 : find(start, DURATION, info);
  if (duration < 0) return film;
  const place = duration + DURATION.length;
  const number = new DataView(start.buffer, place, 8);
  if (number.getFloat64(0) === 0) number.setFloat64(0, milliseconds);
  return new Blob([start, film.slice(start.length)], { type: film.type });
}
