// The picture: frames as they arrive, and over them what the page draws itself, from the frame's own camera.
//
// Events: "frame" with the header; "moved" when the camera has changed; "rest" when it has stayed for a while.

const LARGEST = 1280; // pixels of the longer side of a frame
const REST = 350; // milliseconds
const REMEMBERED = 200; // cameras that frames may still come of

export class View extends EventTarget {
  #frame;
  #over;
  #cameras = new Map();
  #number = 0;
  #isDirty = false;
  #isPainting = false;
  #restTimer = 0;
  #drawing = Promise.resolve();

  constructor(frame, over) {
    super();
    this.#frame = frame;
    this.#over = over;
    this.camera = null;
    this.shownCamera = null;
    this.settings = { renderer: "", layer: "radiance", exposure: "auto", tone_map: "linear", scale_maximum: "auto" };
    this.painters = [];
    this.isAtRest = false;
    this.say = () => false;
    new ResizeObserver(() => this.#fit()).observe(over);
  }

  /** Look through a camera. */
  take(camera) {
    this.camera = camera;
    this.#fit();
    this.changed();
  }

  /** The camera or what is asked of frames has changed: ask for the newest once in a screen's frame. */
  changed() {
    this.isAtRest = false;
    clearTimeout(this.#restTimer);
    this.#restTimer = setTimeout(() => {
      this.isAtRest = true;
      this.dispatchEvent(new Event("rest"));
      this.repaint();
    }, REST);
    if (this.#isDirty) return;
    this.#isDirty = true;
    requestAnimationFrame(() => {
      this.#isDirty = false;
      this.ask();
      this.dispatchEvent(new Event("moved"));
    });
  }

  /** Ask for frames of the camera as it is. */
  ask() {
    if (!this.camera) return;
    this.#number += 1;
    const id = String(this.#number);
    this.#cameras.set(id, this.camera.copy());
    this.#cameras.delete(String(this.#number - REMEMBERED));
    const { renderer, ...settings } = this.settings;
    this.say({ type: "camera", id, ...this.camera.fields, ...settings, ...(renderer && { renderer }), format: "webp" });
  }

  /** Show a frame; resolves when it is on the screen. Frames are shown in the order in which they came. */
  show(header, blob) {
    this.#drawing = this.#drawing.then(() => this.#draw(header, blob)).catch(() => {});
    return this.#drawing;
  }

  async #draw(header, blob) {
    const bitmap = await createImageBitmap(blob);
    const camera = this.#cameras.get(header.id) ?? this.camera;
    const canvas = this.#frame;
    if (canvas.width !== camera.width || canvas.height !== camera.height) {
      canvas.width = camera.width;
      canvas.height = camera.height;
    }
    canvas.getContext("2d").drawImage(bitmap, 0, 0, canvas.width, canvas.height);
    bitmap.close();
    this.shownCamera = camera;
    this.dispatchEvent(new CustomEvent("frame", { detail: header }));
    this.repaint();
  }

  /** Draw again what lies over the frame. */
  repaint() {
    if (this.#isPainting) return;
    this.#isPainting = true;
    requestAnimationFrame(() => {
      this.#isPainting = false;
      this.#paint();
    });
  }

  #paint() {
    const camera = this.shownCamera;
    const canvas = this.#over;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.round(side * ratio));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const pen = canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!camera) return;
    pen.setTransform(width / camera.width, 0, 0, height / camera.height, 0, 0);
    for (const paint of this.painters) paint(pen, camera);
  }

  /** The place in the frame of a pointer's event. */
  place({ clientX, clientY }) {
    const { left, top, width, height } = this.#over.getBoundingClientRect();
    const { width: w, height: h } = this.shownCamera ?? this.camera;
    return [((clientX - left) * w) / width, ((clientY - top) * h) / height];
  }

  #fit() {
    if (!this.camera) return;
    const [width, height] = [this.#over.clientWidth, this.#over.clientHeight];
    if (width < 2 || height < 2) return;
    const factor = Math.min(1, LARGEST / Math.max(width, height));
    const size = [Math.max(2, Math.round(width * factor)), Math.max(2, Math.round(height * factor))];
    if (size[0] === this.camera.width && size[1] === this.camera.height) return;
    [this.camera.width, this.camera.height] = size;
    this.changed();
  }
}
