// How frames are asked for: camera of the scene, renderer, layer, scale, exposure, tones, tolerance.

import { Camera } from "./camera.js";

const CHOICES = { renderer: "renderer", layer: "layer", tone: "tone_map" }; // settings by their elements

export class SettingsPanel {
  #find;
  #view;
  #cameras = {};

  /** `configure` is told a new tolerance, a relative error. */
  constructor(find, view, configure) {
    this.#find = find;
    this.#view = view;
    for (const [id, name] of Object.entries(CHOICES)) {
      find(id).addEventListener("change", ({ target }) => this.take({ [name]: target.value }));
    }
    find("scale").addEventListener("change", ({ target }) => {
      this.take({ scale_maximum: Number(target.value) > 0 ? Number(target.value) : "auto" });
    });
    const expose = () => this.take({ exposure: find("auto").checked ? "auto" : Number(find("exposure").value) });
    find("auto").addEventListener("change", expose);
    find("exposure").addEventListener("input", expose);
    find("tolerance").addEventListener("change", ({ target }) => {
      if (Number(target.value) > 0) configure(Number(target.value) / 100);
    });
    find("cameras").addEventListener("change", ({ target }) => {
      const chosen = this.#cameras[target.value];
      if (chosen) view.take(new Camera(chosen));
    });
    view.addEventListener("moved", () => {
      if (document.activeElement !== find("cameras")) find("cameras").value = "";
    });
    this.#show();
  }

  /** Ask for frames that are otherwise. */
  take(settings) {
    Object.assign(this.#view.settings, settings);
    if (settings.renderer) this.#find("caption").textContent = `${settings.renderer}: the first frame is on its way…`;
    this.#show();
    this.#view.changed();
  }

  listCameras(cameras) {
    this.#cameras = cameras;
    const list = this.#find("cameras");
    const names = Object.keys(cameras);
    if (list.dataset.names === JSON.stringify(names)) return;
    list.dataset.names = JSON.stringify(names);
    list.replaceChildren(new Option("free", ""), ...names.map((name) => new Option(name, name)));
  }

  showTolerance(tolerance) {
    const field = this.#find("tolerance");
    if (document.activeElement !== field) field.value = Number((100 * tolerance).toPrecision(4));
  }

  #show() {
    const find = this.#find;
    const { layer, exposure, scale_maximum: maximum } = this.#view.settings;
    for (const [id, name] of Object.entries(CHOICES)) find(id).value = this.#view.settings[name];
    find("scale-label").hidden = layer !== "false_colour";
    find("scale").value = maximum === "auto" ? "" : maximum;
    find("auto").checked = exposure === "auto";
    find("exposure").disabled = exposure === "auto";
    if (exposure !== "auto") find("exposure").value = exposure;
    find("stops").textContent = exposure === "auto" ? "" : `${exposure} stops`;
  }
}
