// Unpacks a state, which `Session._state` has packed in Python, for the drawing, the graphs and the read-outs.

export function unpacked(buffer, columns, curves) {
  const view = new DataView(buffer),
    word = (at) => view.getUint32(at, true);
  const points = word(12),
    forces = word(16),
    colours = word(24);
  let at = 36;
  const next = (count) => new Float32Array(buffer, (at += 4 * count) - 4 * count, count);
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
