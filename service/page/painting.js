// Figures of overlays on a 2D canvas: projected, and hidden where the frame's depth says that something is before.

import { get } from "./api.js";
import { Raster } from "./raster.js";

const PIECE = 7; // pixels of a line that are seen or hidden together
const SLACK = 0.015; // relative: what lies on a surface is not behind it
const NEAR = 1e-6;

/** What the camera sees first: depths in metres along its direction. */
export class Depth {
  constructor(values, width, height, camera) {
    Object.assign(this, { values, width, height, camera });
  }

  static async of(session, camera, options) {
    const width = Math.max(1, Math.round(camera.width / 2));
    const height = Math.max(1, Math.round(camera.height / 2));
    const query = { ...camera.query, width, height, layer: "depth", format: "npy" };
    const buffer = await (await get(`/v1/sessions/${session}/frame`, query, options)).arrayBuffer();
    const start = 10 + new DataView(buffer).getUint16(8, true); // npy 1.0: magic, version, length of the header
    const all = new Float32Array(buffer.slice(start));
    return new Depth(Float32Array.from({ length: width * height }, (_, k) => all[3 * k]), width, height, camera);
  }

  isOf(camera) {
    const { eye, target, fov, width, height } = this.camera;
    return eye === camera.eye && target === camera.target && fov === camera.fov && width === camera.width
      && height === camera.height;
  }

  hides(x, y, depth) {
    const column = Math.floor((x * this.width) / this.camera.width);
    const row = Math.floor((y * this.height) / this.camera.height);
    if (column < 0 || row < 0 || column >= this.width || row >= this.height) return true;
    return depth > this.values[row * this.width + column] * (1 + SLACK);
  }
}

/** Paint figures as `camera` sees them. Without a depth nothing is hidden, and what is filled is left out. */
export function paintFigures(pen, camera, figures, depth) {
  const project = camera.projector();
  for (const { corners, position, colour } of figures) {
    if (corners === 1) paintPoints(pen, project, position, colour, depth);
    else if (corners === 2) paintLines(pen, project, position, colour, depth);
    else if (depth) pen.drawImage(Raster.of(camera, position, colour).canvas, 0, 0);
  }
}

const at = (position, k) => [position[3 * k], position[3 * k + 1], position[3 * k + 2]];

function paintPoints(pen, project, position, colour, depth) {
  for (let k = 0; k < colour.length; k += 1) {
    const [x, y, z] = project(at(position, k));
    if (!(z > NEAR) || depth?.hides(x, y, z)) continue;
    pen.fillStyle = colour[k];
    pen.fillRect(x - 1.5, y - 1.5, 3, 3);
  }
}

function paintLines(pen, project, position, colour, depth) {
  const paths = new Map();
  for (let k = 0; k < colour.length; k += 1) {
    const from = project(at(position, 2 * k));
    const to = project(at(position, 2 * k + 1));
    if (!(from[2] > NEAR && to[2] > NEAR)) continue;
    if (!paths.has(colour[k])) paths.set(colour[k], new Path2D());
    trace(paths.get(colour[k]), from, to, depth);
  }
  pen.lineWidth = 1;
  for (const [style, path] of paths) {
    pen.strokeStyle = style;
    pen.stroke(path);
  }
}

function trace(path, from, to, depth) {
  const pieces = depth ? Math.max(1, Math.ceil(Math.hypot(to[0] - from[0], to[1] - from[1]) / PIECE)) : 1;
  const step = (t) => {
    // Straight in the picture: depth goes with 1 / z.
    const z = 1 / ((1 - t) / from[2] + t / to[2]);
    return [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1]), z];
  };
  let isDown = false;
  for (let k = 0; k < Math.min(pieces, 400); k += 1) {
    const [t0, t1] = [k / pieces, (k + 1) / pieces];
    const middle = step((t0 + t1) / 2);
    const isSeen = !depth || !depth.hides(...middle);
    if (isSeen) {
      const [x0, y0] = step(t0);
      const [x1, y1] = step(t1);
      if (!isDown) path.moveTo(x0, y0);
      path.lineTo(x1, y1);
    }
    isDown = isSeen;
  }
}
