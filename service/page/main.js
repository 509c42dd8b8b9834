// The page: opens or joins a session, and joins picture, panel, progress and overlays to it.

import * as api from "./api.js";
import { Camera } from "./camera.js";
import { control } from "./controls.js";
import { Gizmo } from "./gizmo.js";
import { showLegend } from "./legend.js";
import { ballOf, box, freeId, lamp, worldVertices } from "./objects.js";
import { ACCEPTED, openFile, openSample } from "./opening.js";
import { listOverlays, Overlays } from "./overlays.js";
import { Panel } from "./panel.js";
import { Curve, percent, showLog, showStatus } from "./progress.js";
import { acceptFiles, handleModes, listen } from "./keys.js";
import { Session } from "./session.js";
import { SettingsPanel } from "./settings.js";
import { addressOf, readAddress } from "./share.js";
import { add, scale } from "./vectors.js";
import { View } from "./view.js";

const find = (id) => document.getElementById(id);
const page = find("viewer"); // its data tell scripts how things stand

const view = new View(find("frame"), find("over"));
const gizmo = new Gizmo(view);
const overlays = new Overlays(view);
const panel = new Panel(find);
const curve = new Curve(find("curve"));
let session = null;
let sample = "cornell";

// --- sessions ---

let beginnings = 0;

/** Open a session, and leave the one before: if it cannot be had, that stays. */
async function begin(opening) {
  beginnings += 1;
  const number = beginnings;
  clearProblem();
  try {
    const status = await opening();
    if (number !== beginnings) {
      api.end(status.id); // something else was chosen meanwhile
      return;
    }
    leave();
    await join(status, null);
  } catch (error) {
    if (number === beginnings) fail(error);
  }
}

/** Leave the session; end it where nobody else can know of it. */
function leave() {
  if (!session) return;
  session.close();
  overlays.attach(null);
  if (session.isOwn && !session.wasShared) api.end(session.id);
  session = null;
  overlays.picked = null;
}

async function join(status, camera) {
  const joined = new Session(status);
  joined.isOwn = camera === null;
  session = joined;
  curve.clear();
  for (const part of [gizmo, overlays, panel]) part.attach(joined);
  joined.addEventListener("status", () => {
    curve.add(joined.status);
    showStatus(find, joined.status);
    page.dataset.state = joined.status.state;
    page.dataset.revision = joined.status.revision;
    settings.showTolerance(joined.status.settings.error_tolerance);
  });
  joined.addEventListener("scene", () => {
    settings.listCameras(joined.scene.cameras ?? {});
    view.repaint();
  });
  joined.addEventListener("log", () => {
    showLog(find("log"), find("log-summary"), joined.log);
    page.dataset.unsettled = joined.log.filter(({ state }) => state !== "settled").length;
  });
  joined.addEventListener("open", () => {
    page.dataset.connection = "open";
    find("banner").hidden = true;
    view.ask();
    joined.refresh();
  });
  joined.addEventListener("waiting", ({ detail }) => {
    page.dataset.connection = "waiting";
    find("banner-text").textContent = `The connection is lost. Trying again in ${detail.seconds} s.`;
    find("banner").hidden = false;
  });
  joined.addEventListener("gone", ({ detail }) => {
    page.dataset.connection = "gone";
    find("banner").hidden = true;
    if (detail.status === 401) fail(detail);
    else complain(detail.status === 404
      ? "This session is gone: it was ended, or the service was started anew without it."
      : detail.message, true);
  });
  joined.addEventListener("problem", ({ detail }) => complain(detail.message));
  joined.addEventListener("frame", async ({ detail: { header, blob } }) => {
    await view.show(header, blob);
    joined.stream.acknowledge(header.number);
  });
  view.say = (message) => joined.stream?.say(message) ?? false;
  await joined.start();
  const cameras = joined.scene.cameras ?? {};
  view.take(new Camera(camera ?? cameras.main ?? Object.values(cameras)[0] ?? (await overview(joined))));
  remember();
}

/** A camera for scenes that have none. */
async function overview(joined) {
  const { centre, radius } = ballOf(joined.objects.flatMap(worldVertices));
  return { eye: add(centre, scale([0.6, -0.8, 0.45], 2.2 * radius)), target: centre, up: [0, 0, 1] };
}

// --- messages ---

function complain(text, isOver = false) {
  find("problem-text").textContent = text;
  find("restart").hidden = !isOver;
  find("problem").hidden = false;
}

function clearProblem() {
  find("problem").hidden = true;
  find("banner").hidden = true;
}

function fail(error) {
  if (error.name === "AbortError") return;
  find("placeholder").textContent = "No session.";
  if (error.status === 401) {
    find("guard").hidden = false;
    find("token").focus();
  } else {
    complain(error.status === 404 ? "This session is gone." : error.message, !session || error.status === 404);
  }
}

// --- the picture ---

const sinks = [];

view.addEventListener("frame", ({ detail: header }) => {
  find("placeholder").hidden = true;
  Object.assign(page.dataset, {
    frame: header.number, quality: header.quality, converged: header.converged, shown: header.revision,
  });
  const atRest = header.converged ? "converged" : `error ${percent(header.error_estimate)}`;
  const how = header.quality === "moving" ? "moving" : atRest;
  find("caption").textContent = `${header.renderer}, ${header.width} × ${header.height}, ${how}`;
  showLegend(find("legend"), header.scale_maximum);
  const now = performance.now();
  sinks.push({ now, bytes: header.bytes });
  while (sinks[0].now < now - 1000) sinks.shift();
  const bytes = sinks.reduce((sum, sink) => sum + sink.bytes, 0);
  find("rate").textContent = `${sinks.length} frames/s, ${(bytes / 1000).toFixed(0)} kB/s`;
});
view.addEventListener("rest", remember);

control(find("over"), view, {
  grab: (x, y) => gizmo.grab(x, y),
  hover: (x, y) => { find("over").dataset.handle = gizmo.hover(x, y); },
  extent: () => ballOf((session?.objects ?? []).flatMap(worldVertices)).radius || 1,
  click: async (x, y) => {
    const { camera } = view;
    const inside = (at, side) => Math.max(0, Math.min(side - 1, Math.floor(at)));
    try {
      const found = await api.pick(session.id, camera, inside(x, camera.width), inside(y, camera.height));
      panel.select(found.hit ? found.object : null);
      overlays.pick(found);
      find("picked").textContent = found.hit
        ? `${found.object}: ${found.illuminance.toPrecision(3)} lux at the click` : "";
    } catch (error) {
      complain(error.message);
    }
  },
});

// --- the panel ---

panel.addEventListener("select", ({ detail }) => {
  gizmo.id = detail;
  page.dataset.selected = detail ?? "";
  view.repaint();
});

function lookAtSelected() {
  if (!panel.object) return;
  const { centre, radius } = ballOf(worldVertices(panel.object));
  view.camera.frame(centre, radius);
  view.changed();
}
find("focus").addEventListener("click", lookAtSelected);
const setMode = handleModes((mode) => {
  gizmo.mode = mode;
  view.repaint();
});
listen({
  undo: () => session?.undo(),
  redo: () => session?.redo(),
  help: () => find("help").showModal(),
  deselect: () => panel.select(null),
  remove: () => panel.remove(),
  focus: lookAtSelected,
  mode: setMode,
}, find("over"), find("help"));
acceptFiles(find("drop"), (file) => begin(() => openFile(file)));

/** Where something new is put: on what was clicked, else before the camera. */
function spot(size) {
  const { picked } = overlays;
  return picked ? add(picked.point, scale(picked.normal, 0.51 * size)) : view.camera.target;
}

function put(stem, make) {
  if (!session?.scene) return;
  const size = 0.25 * (ballOf(session.objects.flatMap(worldVertices)).radius || 1);
  const object = make(freeId(session.objects, stem), size);
  session.edit([{ op: "add", object }]).then((went) => { if (went) panel.select(object.id); });
}
find("add-box").addEventListener("click", () => put("box", (id, size) => box(id, spot(size), size)));
find("add-lamp").addEventListener("click", () => put("lamp", (id, size) => lamp(
  id, add(overlays.picked?.point ?? view.camera.target, scale(view.camera.up, 1.5 * size)), size, view.camera.up, 20,
)));

listOverlays(find, overlays, remember);
const settings = new SettingsPanel(find, view, (tolerance) => session?.configure({ error_tolerance: tolerance }));

// --- the header ---

find("undo").addEventListener("click", () => session?.undo());
find("redo").addEventListener("click", () => session?.redo());
find("dismiss").addEventListener("click", clearProblem);
find("retry").addEventListener("click", () => session?.stream.retry());
find("restart").addEventListener("click", () => begin(() => openSample(sample)));
find("help-open").addEventListener("click", () => find("help").showModal());
find("sample").addEventListener("change", ({ target }) => {
  sample = target.value;
  begin(() => openSample(sample));
});
find("file").accept = ACCEPTED;
find("file").addEventListener("change", ({ target }) => {
  const [file] = target.files;
  target.value = "";
  if (file) begin(() => openFile(file));
});
find("guard").addEventListener("submit", (event) => {
  event.preventDefault();
  api.token.value = find("token").value;
  find("guard").hidden = true;
  start();
});
find("share").addEventListener("click", async () => {
  if (!session) return;
  session.wasShared = true;
  remember();
  const button = find("share");
  try {
    await navigator.clipboard.writeText(location.href);
    button.textContent = "Copied";
  } catch {
    button.textContent = "It is the address above";
  }
  setTimeout(() => { button.textContent = "Copy a link"; }, 2000);
});

/** Keep the address that of what is seen. */
function remember() {
  if (session) history.replaceState(null, "", addressOf(session, view.camera, view.settings, overlays.names));
}

// --- the beginning ---

async function start() {
  const address = readAddress();
  if (address.token) {
    api.token.value = address.token;
    history.replaceState(null, "", location.pathname + location.search);
  }
  settings.take(address.settings);
  for (const name of address.overlays) {
    const chosen = document.getElementById(`overlay-${name}`);
    if (chosen) chosen.click();
  }
  try {
    const list = find("sample");
    const scenes = await api.scenes();
    list.replaceChildren(...scenes.map(({ name }) => new Option(name.replaceAll("_", " "), name)));
    if (scenes.some(({ name }) => name === address.scene)) sample = address.scene;
    list.value = sample;
    list.disabled = false;
    if (address.session) await join(await api.statusOf(address.session), address.camera ?? undefined);
    else await begin(() => openSample(sample));
  } catch (error) {
    fail(error);
  }
}

start();
