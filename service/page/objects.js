// Objects of the scene document: where they are, how they move, and new ones.

import {
  add, composed, cross, length, multiplied, quaternion, scale, subtract, transformed, turnAbout, turned, unit,
} from "./vectors.js";

/** The map of an object's mesh to the world. */
export function placing(object) {
  const { matrix, translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale: size = 1 } = object.transform ?? {};
  if (matrix) return (p) => transformed(matrix, p);
  const factors = Array.isArray(size) ? size : [size, size, size];
  const axis = unit(rotation);
  const angle = 2 * Math.atan2(length(rotation), rotation[3]);
  return (p) => add(turned([p[0] * factors[0], p[1] * factors[1], p[2] * factors[2]], axis, angle), translation);
}

export const worldVertices = (object) => object.mesh.vertices.map(placing(object));

export function boundsOf(points) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (const point of points) {
    for (let k = 0; k < 3; k += 1) {
      low[k] = Math.min(low[k], point[k]);
      high[k] = Math.max(high[k], point[k]);
    }
  }
  return points.length ? { low, high } : { low: [-1, -1, -1], high: [1, 1, 1] };
}

export function ballOf(points) {
  const { low, high } = boundsOf(points);
  return { centre: scale(add(low, high), 0.5), radius: 0.5 * length(subtract(high, low)) };
}

/** An object's transform after a turn about a point and a shift; parts stay parts, a matrix stays one. */
export function movedTransform(object, { shift = [0, 0, 0], axis = [0, 0, 1], angle = 0, centre = [0, 0, 0] }) {
  const before = object.transform ?? {};
  if (before.matrix) return { matrix: multiplied(turnAbout(centre, axis, angle, shift), before.matrix) };
  const arm = subtract(before.translation ?? [0, 0, 0], centre);
  return {
    ...before,
    translation: add(add(centre, turned(arm, axis, angle)), shift),
    rotation: composed(quaternion(axis, angle), before.rotation ?? [0, 0, 0, 1]),
  };
}

/** A name that no object has. */
export function freeId(objects, stem) {
  const taken = new Set(objects.map(({ id }) => id));
  let number = 1;
  while (taken.has(`${stem}_${number}`)) number += 1;
  return `${stem}_${number}`;
}

const CORNERS = [0, 1, 2, 3, 4, 5, 6, 7].map((k) => [k & 1, (k >> 1) & 1, k >> 2].map((bit) => bit - 0.5));
const SIDES = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];

/** A cube whose middle is at a place. */
export function box(id, middle, size) {
  return {
    id,
    mesh: { vertices: CORNERS, faces: SIDES },
    material: { reflectance: [0.6, 0.6, 0.6] },
    transform: { translation: middle, scale: [size, size, size] },
  };
}

/** A square lamp that shines against `up`. */
export function lamp(id, middle, size, up, exitance) {
  const side = unit(cross(up, Math.abs(up[0]) < 0.9 ? [1, 0, 0] : [0, 1, 0]));
  const other = cross(up, side);
  const corner = (s, t) => add(scale(side, s * 0.5 * size), scale(other, t * 0.5 * size));
  return {
    id,
    mesh: { vertices: [corner(-1, -1), corner(-1, 1), corner(1, 1), corner(1, -1)], faces: [[0, 1, 2, 3]] },
    material: { reflectance: [0, 0, 0], emission: [exitance, exitance, exitance] },
    transform: { translation: middle },
  };
}
