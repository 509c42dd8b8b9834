// What the session holds besides its light, drawn over the picture: fetched while the camera rests.

import { get, Problem } from "./api.js";
import { elementFigures } from "./elements.js";
import { readOverlay } from "./glb.js";
import { Depth, paintFigures } from "./painting.js";

const PAUSE = 700; // milliseconds between two looks
const LONGEST = 60000; // milliseconds that an overlay is waited for

const place = ({ picked: { point: [x, y, z], patch } }) => ({ x, y, z, patch });
const ofElement = ({ picked }) => (picked ? { element: picked.element } : {});

/** Overlays: their path, what they are called, and their query; null where a click on the picture is needed. */
const OVERLAYS = [
  { name: "mesh", label: "Elements", query: () => ({ limit: 10000 }) },
  { name: "links", label: "Links (of the clicked element)", query: (now) => ({ limit: 3000, ...ofElement(now) }) },
  { name: "discontinuities", label: "Discontinuities", query: ({ camera }) => ({ ...camera.query, active: "true" }) },
  { name: "triangulation", label: "Triangulation", query: ({ camera }) => camera.query },
  { name: "samples", label: "Samples", query: ({ camera }) => camera.query },
  {
    name: "graph",
    label: "Error surface of the clicked element",
    query: (now) => now.picked && { ...now.camera.query, ...ofElement(now), kind: "difference" },
  },
  {
    name: "probe",
    label: "Irradiance probe at the click",
    query: (now) => now.picked && { ...cameraOf(now), ...place(now) },
  },
  {
    name: "backprojection",
    label: "Backprojection from the click",
    query: (now) => now.picked && { ...cameraOf(now), ...place(now) },
  },
];

const cameraOf = ({ camera }) => camera.query;

export class Overlays extends EventTarget {
  #view;
  #session = null;
  #shown = new Map(); // by name: {key, figures, facts, problem}
  #depth = null;
  #timer = 0;
  #waiting = new AbortController();

  constructor(view) {
    super();
    this.#view = view;
    this.picked = null;
    view.painters.unshift((pen, camera) => this.#paint(pen, camera));
    view.addEventListener("rest", () => this.look());
    view.addEventListener("moved", () => this.#abandon());
  }

  /** Show what a session holds; null: of none. */
  attach(session) {
    this.#abandon();
    this.#session = session;
    this.picked = null;
    this.#depth = null;
    for (const overlay of this.#shown.values()) Object.assign(overlay, { key: "", figures: [], facts: null });
    if (!session) return;
    let { revision } = session.status;
    session.addEventListener("status", () => {
      if (session.status.revision !== revision) this.#abandon();
      revision = session.status.revision;
      this.look(PAUSE);
    });
  }

  get names() {
    return [...this.#shown.keys()];
  }

  /** Show an overlay, or no longer. */
  toggle(name, isOn) {
    this.#abandon();
    if (isOn) this.#shown.set(name, { key: "", figures: [], facts: null, problem: null });
    else this.#shown.delete(name);
    this.look();
    this.#changed();
  }

  /** What was clicked; null where that was nothing. */
  pick(picked) {
    this.picked = picked?.hit ? picked : null;
    this.look();
  }

  /** What is to be told of an overlay. */
  note(name) {
    const overlay = this.#shown.get(name);
    if (!overlay) return "";
    if (overlay.problem) return overlay.problem;
    if (overlay.key === null) return "Click on a surface first.";
    if (!overlay.facts) return this.#canBeHad(name) ? "…" : "once the light rests";
    const { count, total } = overlay.facts;
    return total > count ? `${count.toLocaleString()} of ${total.toLocaleString()}` : total.toLocaleString();
  }

  /** Fetch what is missing, soon. */
  look(delay = 50) {
    if (this.#timer || !this.#session || this.#shown.size === 0) return;
    this.#timer = setTimeout(async () => {
      // What fails here for want of a connection is fetched when the status comes again.
      await this.#fetchAll().catch(() => {});
      this.#timer = 0;
      if (this.#isStale()) this.look(PAUSE);
    }, delay);
  }

  /** What is being fetched is of a view that is no more. */
  #abandon() {
    this.#waiting.abort();
    this.#waiting = new AbortController();
  }

  get #now() {
    return { camera: this.#view.camera, picked: this.picked };
  }

  /** What an overlay depends on: where it is the same, nothing new would come. */
  #key(name, query) {
    const { revision, state, statistics } = this.#session.status;
    const counts = name === "mesh" || name === "links" ? statistics.elements : statistics.interpolants;
    return JSON.stringify([this.#session.id, query, revision, state, state === "solving" ? 0 : counts]);
  }

  /** Whether there may be something to show: most overlays are of a solution at rest. */
  #canBeHad(name) {
    return this.#session !== null && (this.#session.status.state !== "solving" || AT_ONCE.includes(name));
  }

  #isStale() {
    if (!this.#session || !this.#view.isAtRest) return false;
    return OVERLAYS.some(({ name, query }) => {
      const overlay = this.#shown.get(name);
      const asked = overlay && this.#canBeHad(name) && query(this.#now);
      return asked && overlay.key !== this.#key(name, asked);
    });
  }

  async #fetchAll() {
    if (!this.#session || !this.#view.isAtRest || this.#session.isDragging) return;
    const session = this.#session;
    await this.#fetchDepth(session);
    for (const { name, query } of OVERLAYS) {
      const overlay = this.#shown.get(name);
      if (!overlay || !this.#canBeHad(name)) continue;
      const asked = query(this.#now);
      if (!asked) {
        Object.assign(overlay, { key: null, figures: [], facts: null, problem: null });
        continue;
      }
      const key = this.#key(name, asked);
      if (overlay.key === key) continue;
      await this.#fetch(session, name, overlay, asked);
      overlay.key = key;
      if (session !== this.#session) return;
    }
    this.#changed();
  }

  async #fetch(session, name, overlay, query) {
    try {
      // Colours are finer, and outlines are those of elements, in the table.
      const isTable = name === "mesh";
      const all = { ...query, format: isTable ? "json" : "glb", timeout_ms: LONGEST };
      const { signal } = this.#waiting;
      const answer = await get(`/v1/sessions/${session.id}/overlays/${name}`, all, { signal });
      const read = isTable ? elementFigures(await answer.json()) : readOverlay(await answer.arrayBuffer());
      Object.assign(overlay, read, { problem: null });
    } catch (error) {
      if (!(error instanceof Problem)) throw error;
      Object.assign(overlay, { figures: [], facts: null, problem: error.message });
    }
    this.#changed();
  }

  async #fetchDepth(session) {
    const camera = this.#view.camera.copy();
    const { revision } = session.status;
    if (this.#depth?.isOf(camera) && this.#depth.revision === revision) return;
    this.#depth = await Depth.of(session.id, camera, { signal: this.#waiting.signal });
    this.#depth.revision = revision;
  }

  #paint(pen, camera) {
    const depth = this.#view.isAtRest && this.#depth?.isOf(camera) ? this.#depth : null;
    for (const { name } of OVERLAYS) {
      const overlay = this.#shown.get(name);
      if (overlay) paintFigures(pen, camera, overlay.figures, isOnSurfaces(name) ? depth : null);
    }
  }

  #changed() {
    this.#view.repaint();
    this.dispatchEvent(new Event("change"));
  }
}

const AT_ONCE = ["mesh", "links", "backprojection"];

// Links cross the room, and heights and views of sources stand off the surfaces: these are not hidden.
const isOnSurfaces = (name) => ["mesh", "discontinuities", "triangulation"].includes(name);

/** List the overlays on the page, each with a box to show it; `changed` is called when one is. */
export function listOverlays(find, overlays, changed) {
  const notes = new Map();
  for (const { name, label } of OVERLAYS) {
    const choice = Object.assign(document.createElement("input"), { type: "checkbox", id: `overlay-${name}` });
    const text = Object.assign(document.createElement("label"), { textContent: ` ${label} ` });
    const note = Object.assign(document.createElement("small"), { id: `note-${name}` });
    const item = document.createElement("li");
    text.prepend(choice);
    item.append(text, note);
    find("overlays").append(item);
    notes.set(name, note);
    choice.addEventListener("change", () => {
      overlays.toggle(name, choice.checked);
      changed();
    });
  }
  overlays.addEventListener("change", () => {
    for (const [name, note] of notes) note.textContent = overlays.note(name);
  });
}
