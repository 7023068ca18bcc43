"use strict";
// Packs of numbers as `mbsim/view/packing.py` makes them: base64, deflated, arrays behind JSON.
mbsim.unpack = (function () {
  const TYPES = { u1: Uint8Array, u2: Uint16Array, i4: Int32Array, u4: Uint32Array, f4: Float32Array };

  function bytesOf(base64) {
    if (Uint8Array.fromBase64) { return Uint8Array.fromBase64(base64); }
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);
    for (let k = 0; k < bytes.length; k += 1) { bytes[k] = text.charCodeAt(k); }
    return bytes;
  }

  async function inflated(bytes) {
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Response(stream).arrayBuffer();
  }

  // Returns {about, arrays}: facts, and typed arrays by name.
  async function read(bytes) {
    const buffer = await inflated(bytes);
    const length = new DataView(buffer).getUint32(0, true);
    const about = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    const arrays = {};
    for (const [name, [kind, at, count]] of Object.entries(about.arrays)) {
      arrays[name] = new TYPES[kind](buffer, 4 + length + at, count);
    }
    return { about, arrays };
  }

  // Whole numbers (rows, columns), row by row, of planes of bytes: differences along the rows of
  // each column, once or twice, with the sign in the lowest bit.
  function fromPlanes(data, planes, order, rows, columns) {
    const found = new Int32Array(rows * columns);
    const size = rows * columns;
    for (let c = 0; c < columns; c += 1) {
      let value = 0, step = 0;
      for (let r = 0; r < rows; r += 1) {
        let folded = 0;
        for (let k = planes - 1; k >= 0; k -= 1) { folded = folded * 256 + data[k * size + c * rows + r]; }
        const change = folded % 2 === 1 ? -(folded + 1) / 2 : folded / 2;
        if (order === 2) { step += change; value += step; } else { value += change; }
        found[r * columns + c] = value;
      }
    }
    return found;
  }

  // Numbers of four bytes whose first bytes are stored together, then the second ones, ...
  function together(data, Type) {
    const count = data.length / 4;
    const bytes = new Uint8Array(data.length);
    for (let k = 0; k < 4; k += 1) {
      for (let n = 0; n < count; n += 1) { bytes[4 * n + k] = data[k * count + n]; }
    }
    return new Type(bytes.buffer);
  }

  return { bytesOf, read, fromPlanes, together };
})();
