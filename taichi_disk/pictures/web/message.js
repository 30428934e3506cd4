// Unpacks a state, which `Session._state` has packed in Python, for the drawing, the graphs and the
// read-outs.

export function unpacked(buffer, columns, curves) {
  let at = 0;
  const next = (count) => {
    const floats = new Float32Array(buffer, at, count);
    at += floats.byteLength;
    return floats;
  };
  const [number, t, points, forces, pulled, colours, limit, fullForce] = next(8);
  const row = Object.fromEntries([...next(columns.length)].map((value, k) => [columns[k], value]));
  return {
    number,
    t,
    pulled,
    limit,
    fullForce,
    row,
    graph: next(curves),
    x: next(2 * points),
    values: next(colours),
    forces: next(3 * forces),
    caption: new TextDecoder().decode(new Uint8Array(buffer, at)),
  };
}
