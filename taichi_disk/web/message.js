// Unpacks a state, which `Session._state` has packed in Python, for the drawing, the graphs and the
// read-outs.

export function unpacked(buffer, columns, curves) {
  const view = new DataView(buffer);
  const word = (place) => view.getUint32(place, true);
  const points = word(12);
  const forces = word(16);
  const colours = word(24);
  let at = 36;
  const next = (count) => {
    const floats = new Float32Array(buffer, at, count);
    at += floats.byteLength;
    return floats;
  };
  const row = Object.fromEntries([...next(columns.length)].map((value, k) => [columns[k], value]));
  const graph = next(curves);
  return {
    number: word(0),
    t: view.getFloat64(4, true),
    pulled: view.getInt32(20, true),
    row,
    graph,
    limit: view.getFloat32(28, true),
    fullForce: view.getFloat32(32, true),
    x: next(2 * points),
    values: next(colours),
    forces: next(3 * forces),
    caption: new TextDecoder().decode(new Uint8Array(buffer, at)),
  };
}
