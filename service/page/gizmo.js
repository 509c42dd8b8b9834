// Handles to move and turn the selected object: arrows along the axes of the world, and rings about them.

import { boundsOf, movedTransform, placing, worldVertices } from "./objects.js";
import { add, cross, dot, scale, subtract, unit } from "./vectors.js";

const AXES = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
const COLOURS = ["#e5484d", "#46a758", "#3e8ede"];
const NAMES = ["x", "y", "z"];
const ARM = 85; // pixels
const REACH = 9; // pixels from a handle that still grab it
const STEPS = 48; // of a ring
const INTERVAL = 90; // milliseconds between two edits while a handle is dragged

export class Gizmo {
  #session;
  #view;
  #hovered = null;
  #dragged = null;

  constructor(view) {
    this.#view = view;
    this.mode = "move";
    this.id = null;
    view.painters.push((pen, camera) => this.#paint(pen, camera));
  }

  attach(session) {
    this.#session = session;
    this.id = null;
  }

  get #object() {
    return this.id === null ? null : this.#session?.object(this.id) ?? null;
  }

  #centre() {
    const { low, high } = boundsOf(worldVertices(this.#object));
    return scale(add(low, high), 0.5);
  }

  /** Handles as lines in the picture: [{axis, places}]. */
  #handles(camera) {
    const centre = this.#dragged?.centre ?? this.#centre();
    const project = camera.projector();
    const [, , depth] = project(centre);
    if (!(depth > 0)) return [];
    const arm = (ARM * depth) / camera.focal;
    return AXES.map((axis, at) => ({ at, places: this.#curve(axis, centre, arm).map(project) }));
  }

  #curve(axis, centre, arm) {
    if (this.mode === "move") return [centre, add(centre, scale(axis, arm))];
    const side = unit(cross(axis, axis[0] ? AXES[1] : AXES[0]));
    const other = cross(axis, side);
    return Array.from({ length: STEPS + 1 }, (_, k) => {
      const angle = (2 * Math.PI * k) / STEPS;
      return add(centre, add(scale(side, arm * Math.cos(angle)), scale(other, arm * Math.sin(angle))));
    });
  }

  #paint(pen, camera) {
    if (!this.#object) return;
    this.#outline(pen, camera);
    for (const { at, places } of this.#handles(camera)) {
      const isLit = (this.#dragged ?? this.#hovered)?.at === at || this.#hovered === at;
      pen.lineWidth = isLit ? 5 : 3;
      pen.strokeStyle = COLOURS[at];
      pen.fillStyle = COLOURS[at];
      pen.beginPath();
      places.forEach(([x, y, depth]) => { if (depth > 0) pen.lineTo(x, y); });
      pen.stroke();
      const [x, y] = places[this.mode === "move" ? 1 : 0];
      pen.beginPath();
      pen.arc(x, y, isLit ? 8 : 6, 0, 2 * Math.PI);
      pen.fill();
      pen.font = "600 12px system-ui, sans-serif";
      pen.fillText(NAMES[at], x + 9, y - 7);
    }
  }

  #outline(pen, camera) {
    const project = camera.projector();
    const { mesh } = this.#object;
    const places = mesh.vertices.map(placing(this.#object)).map(project);
    pen.strokeStyle = "#f0a24a";
    pen.lineWidth = 1.5;
    pen.beginPath();
    for (const face of mesh.faces.slice(0, 3000)) {
      if (face.some((v) => !(places[v][2] > 0))) continue;
      face.forEach((v, k) => (k ? pen.lineTo(places[v][0], places[v][1]) : pen.moveTo(places[v][0], places[v][1])));
      pen.closePath();
    }
    pen.stroke();
  }

  /** The axis whose handle is at a place of the picture, or null. */
  #at(x, y) {
    const camera = this.#view.shownCamera;
    if (!this.#object || !camera) return null;
    let best = null;
    for (const { at, places } of this.#handles(camera)) {
      for (let k = 1; k < places.length; k += 1) {
        const apart = distance([x, y], places[k - 1], places[k]);
        if (apart < (best?.apart ?? REACH)) best = { at, apart };
      }
    }
    return best?.at ?? null;
  }

  hover(x, y) {
    const at = this.#at(x, y);
    if (at !== this.#hovered) this.#view.repaint();
    this.#hovered = at;
    return at !== null;
  }

  /** {drag, drop} where a handle is grabbed, else null. */
  grab(x, y) {
    const at = this.#at(x, y);
    if (at === null) return null;
    const camera = this.#view.shownCamera.copy();
    const centre = this.#centre();
    const measure = this.mode === "move" ? along(camera, centre, AXES[at]) : angleOf(camera, centre, AXES[at]);
    const before = structuredClone(this.#object);
    const from = measure(x, y);
    this.#dragged = { at, centre };
    this.#session.isDragging = true;
    const flow = new Flow(this.#session, this.id);
    return {
      drag: (toX, toY) => {
        const by = measure(toX, toY) - from;
        if (!Number.isFinite(by)) return;
        const isMove = this.mode === "move";
        const change = isMove ? { shift: scale(AXES[at], by) } : { axis: AXES[at], angle: by, centre };
        if (isMove) this.#dragged.centre = add(centre, change.shift);
        flow.put(movedTransform(before, change));
        this.#view.repaint();
      },
      drop: () => {
        this.#dragged = null;
        this.#session.isDragging = false;
        flow.end();
        this.#view.repaint();
      },
    };
  }
}

/** Sends the newest of many transforms, one at a time and not too often; they are undone together. */
class Flow {
  #latest = null;
  #isBusy = false;
  // Of this page and this drag alone.
  #gesture = `drag ${Math.random().toString(36).slice(2)}`;

  constructor(session, id) {
    this.session = session;
    this.id = id;
  }

  put(transform) {
    this.session.object(this.id).transform = transform;
    this.#latest = transform;
    this.#send();
  }

  end() {
    this.hasEnded = true;
    this.#send();
  }

  async #send() {
    if (this.#isBusy || !this.#latest) return;
    this.#isBusy = true;
    const transform = this.#latest;
    this.#latest = null;
    const pause = this.hasEnded ? null : new Promise((resolve) => { setTimeout(resolve, INTERVAL); });
    await this.session.edit([{ op: "move", id: this.id, transform }], this.#gesture);
    await pause;
    this.#isBusy = false;
    this.#send();
  }
}

function distance([x, y], [ax, ay, az], [bx, by, bz]) {
  if (!(az > 0 && bz > 0)) return Infinity;
  const [dx, dy] = [bx - ax, by - ay];
  const t = Math.max(0, Math.min(1, ((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(x - ax - t * dx, y - ay - t * dy);
}

/** How far along an axis through a point the nearest place to a pixel's ray is, metres. */
function along(camera, centre, axis) {
  return (x, y) => {
    const ray = camera.ray(x, y);
    const between = subtract(centre, camera.eye);
    const cosine = dot(ray, axis);
    return (cosine * dot(ray, between) - dot(axis, between)) / (1 - cosine * cosine);
  };
}

/** The angle about an axis through a point at which a pixel's ray meets the plane across it, radians. */
function angleOf(camera, centre, axis) {
  const side = unit(cross(axis, axis[0] ? AXES[1] : AXES[0]));
  const other = cross(axis, side);
  let last = null;
  return (x, y) => {
    const ray = camera.ray(x, y);
    const t = dot(subtract(centre, camera.eye), axis) / dot(ray, axis);
    const arm = subtract(add(camera.eye, scale(ray, t)), centre);
    const angle = Math.atan2(dot(arm, other), dot(arm, side));
    // Without a jump where the arctangent has one.
    last = last === null ? angle : angle + 2 * Math.PI * Math.round((last - angle) / (2 * Math.PI));
    return last;
  };
}
