// Triangles of one colour each, drawn into a picture of their own with a buffer of depths: near ones hide far ones.

import { cross, dot, subtract } from "./vectors.js";

const NEAR = 1e-6;
const known = new WeakMap(); // pictures by their positions, with the camera that they are of

const at = (position, k) => [position[3 * k], position[3 * k + 1], position[3 * k + 2]];

export class Raster {
  /** Triangles as a camera sees their fronts; kept until they are asked for from elsewhere. */
  static of(camera, position, colour) {
    const key = JSON.stringify(camera.fields);
    let raster = known.get(position);
    if (raster?.key !== key) {
      raster = new Raster(camera, position, colour);
      raster.key = key;
      known.set(position, raster);
    }
    return raster;
  }

  constructor(camera, position, colour) {
    const { width, height } = camera;
    this.width = width;
    this.height = height;
    this.canvas = Object.assign(document.createElement("canvas"), { width, height });
    const pen = this.canvas.getContext("2d");
    const image = pen.createImageData(width, height);
    this.pixels = new Uint32Array(image.data.buffer);
    this.inverse = new Float64Array(width * height); // 1 / depth: linear in the picture
    const project = camera.projector();
    for (let k = 0; k < colour.length; k += 1) {
      const corners = [0, 1, 2].map((c) => at(position, 3 * k + c));
      const normal = cross(subtract(corners[1], corners[0]), subtract(corners[2], corners[0]));
      if (dot(normal, subtract(camera.eye, corners[0])) <= 0) continue;
      const places = corners.map(project);
      if (places.every(([, , z]) => z > NEAR)) this.#fill(places, pixelOf(colour[k]));
    }
    pen.putImageData(image, 0, 0);
  }

  #fill(places, pixel) {
    const [[ax, ay, az], [bx, by, bz], [cx, cy, cz]] = places;
    const area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay);
    if (area === 0) return;
    const [left, right] = [Math.min(ax, bx, cx), Math.max(ax, bx, cx)];
    const [top, bottom] = [Math.min(ay, by, cy), Math.max(ay, by, cy)];
    for (let y = Math.max(0, Math.floor(top)); y < Math.min(this.height, Math.ceil(bottom)); y += 1) {
      for (let x = Math.max(0, Math.floor(left)); x < Math.min(this.width, Math.ceil(right)); x += 1) {
        const [px, py] = [x + 0.5, y + 0.5];
        const v = ((px - ax) * (cy - ay) - (cx - ax) * (py - ay)) / area;
        const w = ((bx - ax) * (py - ay) - (px - ax) * (by - ay)) / area;
        if (v < 0 || w < 0 || v + w > 1) continue;
        const inverse = (1 - v - w) / az + v / bz + w / cz;
        const place = y * this.width + x;
        if (inverse <= this.inverse[place]) continue;
        this.inverse[place] = inverse;
        this.pixels[place] = pixel;
      }
    }
  }
}

/** An opaque pixel as it lies in memory. */
function pixelOf(hex) {
  const bytes = new Uint8Array([1, 3, 5].map((from) => parseInt(hex.slice(from, from + 2), 16)).concat(255));
  return new Uint32Array(bytes.buffer)[0];
}
