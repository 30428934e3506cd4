// Unpacks a state, which `Session._state` has packed in Python, for the drawing, the graphs and the read-outs.

export function unpacked(buffer, columns, curves) {
  const view = new DataView(buffer), word = (at) => view.getUint32(at, true);
  const number = (at) => view.getFloat32(at, true);
  const points = word(16), forces = word(20), colours = word(28);
  let at = 48;
  const next = (count) => new Float32Array(buffer, (at += 4 * count) - 4 * count, count);
  const row = Object.fromEntries([...next(columns.length)].map((value, k) => [columns[k], value]));
  const graph = next(curves);
  return {
    number: word(0), t: view.getFloat64(8, true), pulled: view.getInt32(24, true),
    limit: number(32), fullForce: number(36), imbalance: number(40), pace: number(44), row, graph,
    x: next(2 * points), values: next(colours), forces: next(3 * forces),
    caption: new TextDecoder().decode(new Uint8Array(buffer, at)),
  };
}
