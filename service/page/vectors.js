// Vectors are arrays of three numbers, quaternions are x, y, z, w, matrices 16 numbers by rows.

export const add = (a, b) => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const subtract = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const scale = (a, s) => [a[0] * s, a[1] * s, a[2] * s];
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [
  a[1] * b[2] - a[2] * b[1],
  a[2] * b[0] - a[0] * b[2],
  a[0] * b[1] - a[1] * b[0],
];
export const length = (a) => Math.hypot(a[0], a[1], a[2]);
export const unit = (a) => scale(a, 1 / (length(a) || 1));

/** `v` turned about the unit vector `axis`, by Rodrigues' formula. */
export function turned(v, axis, angle) {
  const c = Math.cos(angle);
  const along = scale(axis, dot(axis, v) * (1 - c));
  return add(add(scale(v, c), scale(cross(axis, v), Math.sin(angle))), along);
}

/** The quaternion of a turn about a unit vector. */
export function quaternion(axis, angle) {
  return [...scale(axis, Math.sin(angle / 2)), Math.cos(angle / 2)];
}

/** First b, then a. */
export function composed(a, b) {
  const v = add(add(scale(b, a[3]), scale(a, b[3])), cross(a, b));
  return [...v, a[3] * b[3] - dot(a, b)];
}

/** The matrix of an affine map that keeps `centre` where it is, turns about `axis`, then shifts. */
export function turnAbout(centre, axis, angle, shift = [0, 0, 0]) {
  const columns = [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map((e) => turned(e, axis, angle));
  const moved = turned(centre, axis, angle);
  const translation = add(subtract(centre, moved), shift);
  return [0, 1, 2].flatMap((row) => [columns[0][row], columns[1][row], columns[2][row], translation[row]])
    .concat([0, 0, 0, 1]);
}

export function multiplied(a, b) {
  return Array.from({ length: 16 }, (_, at) => {
    const row = 4 * Math.floor(at / 4);
    const column = at % 4;
    return a[row] * b[column] + a[row + 1] * b[column + 4] + a[row + 2] * b[column + 8]
      + a[row + 3] * b[column + 12];
  });
}

export function transformed(m, p) {
  return [
    m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + m[3],
    m[4] * p[0] + m[5] * p[1] + m[6] * p[2] + m[7],
    m[8] * p[0] + m[9] * p[1] + m[10] * p[2] + m[11],
  ];
}
