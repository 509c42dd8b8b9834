// The selected object: what it is, where it is, what it reflects and emits; and what may be done to it.

import { fromHex, toHex } from "./colours.js";
import { ballOf, movedTransform, worldVertices } from "./objects.js";
import { subtract } from "./vectors.js";

const WHITEST = 0.99; // a surface reflects less than it receives
const AXES = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] };

const luminous = (material) => Math.max(0, ...(material.emission ?? [0, 0, 0]));

export class Panel extends EventTarget {
  #find;
  #session = null;

  constructor(find) {
    super();
    this.#find = find;
    this.id = null;
    find("objects").addEventListener("change", ({ target }) => this.select(target.value || null));
    for (const name of ["reflectance", "emission-colour", "emission", "two-sided"]) {
      find(name).addEventListener("change", () => this.#paint());
    }
    for (const name of Object.keys(AXES)) {
      find(`place-${name}`).addEventListener("change", () => this.#move());
      find(`turn-${name}`).addEventListener("click", () => this.#turn(AXES[name]));
    }
    find("delete").addEventListener("click", () => this.remove());
  }

  attach(session) {
    this.#session = session;
    this.select(null);
    session.addEventListener("scene", () => this.show());
  }

  get object() {
    return this.id === null ? null : this.#session?.object(this.id) ?? null;
  }

  /** Select an object by its id, or nothing. */
  select(id) {
    this.id = id;
    this.show();
    this.dispatchEvent(new CustomEvent("select", { detail: id }));
  }

  show() {
    const find = this.#find;
    const { object } = this;
    const objects = this.#session?.objects ?? [];
    const list = find("objects");
    const names = objects.map(({ id }) => id);
    if (list.dataset.names !== JSON.stringify(names)) {
      list.dataset.names = JSON.stringify(names);
      list.replaceChildren(new Option("Nothing selected", ""), ...names.map((id) => new Option(id, id)));
    }
    list.value = object?.id ?? "";
    find("object").disabled = !object;
    if (!object || find("object").contains(document.activeElement)) return;
    const material = object.material ?? {};
    find("reflectance").value = toHex(material.reflectance ?? [0.5, 0.5, 0.5]);
    const most = luminous(material);
    find("emission").value = most ? Number(most.toPrecision(4)) : 0;
    find("emission-colour").value = most ? toHex(material.emission.map((part) => part / most)) : "#ffffff";
    find("two-sided").checked = material.two_sided ?? false;
    const { centre } = ballOf(worldVertices(object));
    Object.keys(AXES).forEach((name, k) => { find(`place-${name}`).value = Number(centre[k].toFixed(3)); });
  }

  #paint() {
    const { object } = this;
    if (!object) return;
    const find = this.#find;
    const before = object.material ?? {};
    const strength = Math.max(0, Number(find("emission").value) || 0);
    const colour = fromHex(find("emission-colour").value);
    const brightest = Math.max(...colour) || 1;
    const specular = before.specular ?? [0, 0, 0];
    const reflectance = fromHex(find("reflectance").value)
      .map((part, k) => Math.min(part, WHITEST, WHITEST - specular[k]));
    const material = {
      ...before,
      reflectance: reflectance.map((part) => Math.max(0, part)),
      emission: colour.map((part) => (strength * part) / brightest),
      two_sided: find("two-sided").checked,
    };
    this.#session.edit([{ op: "set_material", id: object.id, material }]);
  }

  #move() {
    const { object } = this;
    const wanted = Object.keys(AXES).map((name) => Number(this.#find(`place-${name}`).value));
    if (!object || !wanted.every(Number.isFinite)) return;
    const { centre } = ballOf(worldVertices(object));
    // What was not touched is shown rounded, and stays.
    this.#place({ shift: subtract(wanted, centre).map((by) => (Math.abs(by) < 6e-4 ? 0 : by)) });
  }

  #turn(axis) {
    const { object } = this;
    if (!object) return;
    const { centre } = ballOf(worldVertices(object));
    this.#place({ axis, angle: (Number(this.#find("degrees").value) * Math.PI) / 180, centre });
  }

  #place(change) {
    const { object } = this;
    this.#session.edit([{ op: "move", id: object.id, transform: movedTransform(object, change) }]);
  }

  remove() {
    const { object } = this;
    if (!object) return;
    this.select(null);
    this.#session.edit([{ op: "remove", id: object.id }]);
  }
}
