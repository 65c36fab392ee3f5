// Binary frames, as slip_detector/view/view_request.py writes them.

// Return {header, arrays}: the arrays by name, each a typed array with its shape as .shape.
export function readFrame(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  const arrays = {};
  let place = 4 + length;
  for (const [name, type, shape] of header.arrays) {
    const count = shape.reduce((product, n) => product * n, 1);
    const array = type === 'uint8' ? new Uint8Array(buffer, place, count) : new Float32Array(buffer, place, count);
    arrays[name] = Object.assign(array, {shape});
    place += Math.ceil(array.byteLength / 4) * 4;
  }
  return {header, arrays};
}
