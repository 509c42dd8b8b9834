// Overlays as the service sends them: binary glTF of points, lines and triangles with colours of vertices.

import { toHex } from "./colours.js";

const MAGIC = 0x46546c67;
const CORNERS = [1, 2, undefined, undefined, 3]; // by glTF's modes

/** {facts, figures: [{corners, position: Float32Array, colour: text of each figure}]} of a file. */
export function readOverlay(buffer) {
  const view = new DataView(buffer);
  if (view.byteLength < 20 || view.getUint32(0, true) !== MAGIC) throw new Error("This is no binary glTF.");
  const length = view.getUint32(12, true);
  const file = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 20, length)));
  const start = 28 + length;
  const figures = (file.meshes ?? []).flatMap(({ primitives }) => primitives).map((primitive) => {
    const corners = CORNERS[primitive.mode ?? 4];
    const position = floats(file, buffer, start, primitive.attributes.POSITION);
    const colour = colours(file, buffer, start, primitive.attributes.COLOR_0, corners);
    return { corners, position, colour };
  });
  return { facts: file.scenes?.[0]?.extras ?? {}, figures };
}

function placeOf(file, start, index) {
  const accessor = file.accessors[index];
  const view = file.bufferViews[accessor.bufferView];
  return { accessor, stride: view.byteStride, at: start + (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0) };
}

function floats(file, buffer, start, index) {
  const { accessor, at } = placeOf(file, start, index);
  return new Float32Array(buffer.slice(at, at + 12 * accessor.count));
}

/** One colour a figure: that of its first vertex. */
function colours(file, buffer, start, index, corners) {
  const { accessor, stride, at } = placeOf(file, start, index);
  const bytes = new Uint8Array(buffer, at);
  const known = new Map();
  return Array.from({ length: accessor.count / corners }, (_, k) => {
    const from = (stride ?? 4) * k * corners;
    const key = (bytes[from] << 16) | (bytes[from + 1] << 8) | bytes[from + 2];
    if (!known.has(key)) known.set(key, toHex([16, 8, 0].map((shift) => ((key >> shift) & 255) / 255)));
    return known.get(key);
  });
}
