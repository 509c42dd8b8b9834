// What the page knows of its session, and what it does to it.
//
// Events: "status", "scene", "log", "open", "frame", "waiting", "gone", "problem" (detail: an Error).

import { Problem, configure, logOf, sceneOf, statusOf } from "./api.js";
import { Stream } from "./stream.js";

const LOG_INTERVAL = 300; // milliseconds between two looks at the change log while it drains

export class Session extends EventTarget {
  #log = { looking: false, again: false, timer: 0 };
  #sceneRevision = 0;
  #fetching = false;
  #deeds = Promise.resolve();
  #closed = new AbortController();

  constructor(status) {
    super();
    this.id = status.id;
    this.status = status;
    this.scene = null;
    this.log = [];
    this.isDragging = false;
    this.wasShared = false;
  }

  /** Load the scene, then connect. Rejects with a Problem. */
  async start() {
    await this.#loadScene();
    this.stream = new Stream(this.id);
    for (const name of ["open", "frame", "waiting", "gone"]) {
      this.stream.addEventListener(name, ({ detail }) => this.#tell(name, detail));
    }
    this.stream.addEventListener("refused", ({ detail }) => this.#tell("problem", detail.problem));
    this.stream.addEventListener("status", ({ detail }) => this.#take(detail));
    this.#lookAtLog();
  }

  /** Leave the session; what is still being fetched of it is given up. */
  close() {
    this.#closed.abort();
    clearTimeout(this.#log.timer);
    this.stream?.close();
  }

  get #unlessClosed() {
    return { signal: this.#closed.signal };
  }

  get objects() {
    return this.scene?.objects ?? [];
  }

  object(id) {
    return this.objects.find((object) => object.id === id) ?? null;
  }

  /** Apply edits; those of one gesture are undone together. Resolves to whether it went well. */
  edit(edits, gesture = null) {
    for (const edit of edits) this.#anticipate(edit);
    this.#tell("scene");
    return this.#do(() => this.stream.ask({ type: "edits", edits, ...(gesture && { gesture }) }));
  }

  /** Take back the newest deed, whoever did it. */
  undo() { return this.#do(() => this.stream.ask({ type: "undo" })); }

  /** Bring back what was taken back last. */
  redo() { return this.#do(() => this.stream.ask({ type: "redo" })); }

  async configure(settings) {
    try {
      this.#take(await configure(this.id, settings));
    } catch (error) {
      this.#tell("problem", error);
    }
  }

  // One deed after the other, so that undo finds what came before it.
  #do(deed) {
    const done = this.#deeds.then(deed).then(() => true, (error) => {
      this.#tell("problem", error);
      return false;
    }).then((went) => {
      this.#loadScene(true).catch((error) => this.#tell("problem", error));
      this.#lookAtLog();
      return went;
    });
    this.#deeds = done;
    return done;
  }

  // What an edit will do to the document, shown before the service has confirmed it.
  #anticipate(edit) {
    const object = this.object(edit.id);
    if (edit.op === "move" && object) object.transform = edit.transform;
    if (edit.op === "set_material" && object) object.material = edit.material;
    if (edit.op === "add") this.scene.objects.push(edit.object);
    if (edit.op === "remove") this.scene.objects = this.objects.filter(({ id }) => id !== edit.id);
  }

  #take(status) {
    this.status = status;
    this.#tell("status");
    if (status.revision !== this.#sceneRevision) {
      this.#loadScene().catch((error) => this.#tell("problem", error));
      this.#lookAtLog();
    }
  }

  async #loadScene(force = false) {
    if (this.#fetching || this.isDragging) return;
    if (!force && this.scene && this.#sceneRevision === this.status.revision) return;
    this.#fetching = true;
    try {
      const { revision, scene } = await sceneOf(this.id, this.#unlessClosed);
      this.#sceneRevision = revision;
      if (this.isDragging) return;
      this.scene = { cameras: {}, objects: [], ...scene };
      this.#tell("scene");
    } catch (error) {
      // Without a connection the stream says so, and the scene comes when it is back.
      if (error instanceof Problem) throw error;
      if (!this.scene) throw error;
    } finally {
      this.#fetching = false;
    }
  }

  async #lookAtLog() {
    const log = this.#log;
    if (log.looking) {
      log.again = true;
      return;
    }
    log.looking = true;
    log.again = false;
    clearTimeout(log.timer);
    try {
      this.log = (await logOf(this.id, this.#unlessClosed)).entries;
      this.#tell("log");
    } catch {
      // It is looked at again when the status changes.
    }
    log.looking = false;
    if (this.#closed.signal.aborted) return;
    if (log.again || this.log.some(({ state }) => state !== "settled")) {
      log.timer = setTimeout(() => this.#lookAtLog(), LOG_INTERVAL);
    }
  }

  /** Look at everything anew, after the connection was away. */
  async refresh() {
    try {
      this.#take(await statusOf(this.id, this.#unlessClosed));
      await this.#loadScene(true);
      this.#lookAtLog();
    } catch (error) {
      if (error instanceof Problem) this.#tell("problem", error);
    }
  }

  #tell(name, detail = null) {
    if (this.#closed.signal.aborted) return;
    this.dispatchEvent(new CustomEvent(name, { detail }));
  }
}
