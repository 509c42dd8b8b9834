// A pinhole camera that orbits, pans and flies, and the way between space and pixels.

import { add, cross, dot, length, scale, subtract, turned, unit } from "./vectors.js";

const POLE = 0.02; // radians: nearer to straight up or down, "up" would have no meaning

export class Camera {
  constructor({ eye, target, up = [0, 0, 1], vertical_fov: fov = 55 }) {
    this.eye = eye;
    this.target = target;
    this.up = unit(up);
    this.fov = fov;
    this.width = 640;
    this.height = 480;
  }

  copy() {
    return Object.assign(new Camera({ eye: this.eye, target: this.target, up: this.up }), this);
  }

  /** The camera as queries and messages have it. */
  get fields() {
    return {
      eye: this.eye,
      target: this.target,
      up: this.up,
      vertical_fov: this.fov,
      width: this.width,
      height: this.height,
    };
  }

  /** The same for a URL's query. */
  get query() {
    return Object.fromEntries(Object.entries(this.fields).map(([name, value]) => [
      name, Array.isArray(value) ? value.map((part) => Number(part.toPrecision(12))).join(",") : value,
    ]));
  }

  /** Unit vectors to the right, up and ahead in the picture. */
  get axes() {
    const ahead = unit(subtract(this.target, this.eye));
    const right = unit(cross(ahead, this.up));
    return { right, above: cross(right, ahead), ahead };
  }

  get distance() {
    return length(subtract(this.target, this.eye));
  }

  /** Pixels that a metre takes at a metre's distance. */
  get focal() {
    return this.height / 2 / Math.tan((this.fov * Math.PI) / 360);
  }

  /** x, y in pixels from the top left, and the depth along the viewing direction, of a point. */
  projector() {
    const { right, above, ahead } = this.axes;
    const { eye, focal } = this;
    const [middleX, middleY] = [this.width / 2, this.height / 2];
    return (p) => {
      const d = subtract(p, eye);
      const depth = dot(d, ahead);
      return [middleX + (focal * dot(d, right)) / depth, middleY - (focal * dot(d, above)) / depth, depth];
    };
  }

  /** The unit vector from the eye through a place in the picture. */
  ray(x, y) {
    const { right, above, ahead } = this.axes;
    const sideways = scale(right, (x - this.width / 2) / this.focal);
    const upwards = scale(above, (this.height / 2 - y) / this.focal);
    return unit(add(ahead, add(sideways, upwards)));
  }

  /** Turn about the target, by radians. */
  orbit(around, over) {
    const arm = subtract(this.eye, this.target);
    const { right } = this.axes;
    const polar = Math.acos(Math.max(-1, Math.min(1, dot(unit(arm), this.up))));
    const wanted = Math.max(POLE, Math.min(Math.PI - POLE, polar - over));
    const lifted = turned(arm, right, -(polar - wanted));
    this.eye = add(this.target, turned(lifted, this.up, -around));
  }

  /** Turn where the eye is, by radians. */
  look(around, over) {
    const { right } = this.axes;
    const arm = subtract(this.target, this.eye);
    const polar = Math.acos(Math.max(-1, Math.min(1, dot(unit(arm), this.up))));
    const wanted = Math.max(POLE, Math.min(Math.PI - POLE, polar - over));
    this.target = add(this.eye, turned(turned(arm, right, polar - wanted), this.up, -around));
  }

  /** Shift so that what is at the target's distance follows the pointer, by pixels. */
  pan(x, y) {
    const { right, above } = this.axes;
    const metres = this.distance / this.focal;
    this.shift(add(scale(right, -x * metres), scale(above, y * metres)));
  }

  /** Fly: metres to the right, up and ahead. */
  fly(sideways, upwards, forwards) {
    const { right, ahead } = this.axes;
    this.shift(add(add(scale(right, sideways), scale(this.up, upwards)), scale(ahead, forwards)));
  }

  shift(by) {
    this.eye = add(this.eye, by);
    this.target = add(this.target, by);
  }

  /** Come nearer to the target by a factor below 1, or go farther by one above. */
  zoom(factor) {
    this.eye = add(this.target, scale(subtract(this.eye, this.target), factor));
  }

  /** Look at a ball from the same direction, so that it fills a good part of the picture. */
  frame(centre, radius) {
    const away = (2.5 * radius) / Math.tan((this.fov * Math.PI) / 360);
    const back = unit(subtract(this.eye, this.target));
    this.target = centre;
    this.eye = add(centre, scale(back, Math.max(away, 1e-6)));
  }
}
