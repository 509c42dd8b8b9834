// Opens a session on a scene that ships with the service, shows its frame as it improves, and ends the
// session when it is left.

const WIDTH = 640;
const HEIGHT = 480;

const element = (id) => document.getElementById(id);
const show = (id, text) => { element(id).textContent = text; };

let token = new URLSearchParams(location.hash.slice(1)).get("token") ?? "";
let session = null; // {id, ended: AbortController}

function call(path, options = {}) {
  const headers = { ...options.headers };
  if (token) headers.Authorization = `Bearer ${token}`;
  return fetch(path, { ...options, headers });
}

async function expectOk(response) {
  if (response.ok) return response;
  const problem = await response.json().catch(() => ({}));
  const error = new Error(problem.detail ?? response.statusText);
  error.status = response.status;
  throw error;
}

async function listScenes() {
  const { scenes } = await (await expectOk(await call("/v1/scenes"))).json();
  const select = element("sample");
  select.replaceChildren(...scenes.map(({ name }) => new Option(name.replaceAll("_", " "), name)));
  const wanted = new URLSearchParams(location.search).get("scene") ?? "cornell";
  if (scenes.some(({ name }) => name === wanted)) select.value = wanted;
  select.disabled = false;
}

async function open(sample) {
  end();
  element("again").hidden = true;
  element("problem").hidden = true;
  const response = await expectOk(await call("/v1/sessions", {
    method: "POST",
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ sample }),
  }));
  const opened = { id: (await response.json()).id, ended: new AbortController() };
  session = opened;
  await Promise.all([followStatus(opened), followFrames(opened)]);
}

function end() {
  if (!session) return;
  const { id, ended } = session;
  session = null;
  ended.abort();
  // keepalive lets the request outlive the page.
  call(`/v1/sessions/${id}`, { method: "DELETE", keepalive: true }).catch(() => {});
}

// EventSource can send no token, so the stream is read by hand: blocks of "field: value" lines.
async function followStatus(opened) {
  const response = await expectOk(await call(`/v1/sessions/${opened.id}/events`, { signal: opened.ended.signal }));
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  for (;;) {
    const { done, value } = await reader.read();
    if (done) break;
    const blocks = (text + value).split("\n\n");
    text = blocks.pop();
    for (const block of blocks) {
      const fields = new Map(block.split("\n").map((line) => line.split(/: (.*)/s, 2)));
      if (fields.get("event") === "status") showStatus(JSON.parse(fields.get("data")));
      if (fields.get("event") === "end") {
        show("status", "The session has ended.");
        element("again").hidden = false;
        opened.ended.abort();
      }
    }
  }
}

function showStatus(status) {
  element("progress").value = status.state === "converged" ? 1 : status.progress;
  const tolerance = percent(status.settings.error_tolerance);
  show("status", {
    solving: `Solving to ${tolerance}…`,
    converged: `Converged to ${tolerance}.`,
    paused: "Stopped at a limit.",
    failed: "The solve failed.",
  }[status.state] ?? status.state);
  show("error", percent(status.error_estimate));
  show("elements", status.statistics.elements.toLocaleString());
  show("links", status.statistics.links.toLocaleString());
  show("seconds", `${status.statistics.seconds.toFixed(2)} s`);
  element("warnings").replaceChildren(...status.warnings.map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
}

// The first frame at once, then each that is better by half, until the solution is converged.
async function followFrames(opened) {
  const image = element("frame");
  let wait = "none";
  let etag = "";
  while (!opened.ended.signal.aborted) {
    const query = new URLSearchParams({ format: "png", width: WIDTH, height: HEIGHT, wait, timeout_ms: 2000 });
    const response = await call(`/v1/sessions/${opened.id}/frame?${query}`, {
      signal: opened.ended.signal,
      cache: "no-store",
      headers: etag ? { "If-None-Match": etag } : {},
    });
    if (response.status !== 304) {
      await expectOk(response);
      const url = URL.createObjectURL(await response.blob());
      image.onload = () => URL.revokeObjectURL(url);
      image.src = url;
      image.hidden = false;
      element("placeholder").hidden = true;
    }
    const same = etag === response.headers.get("ETag");
    etag = response.headers.get("ETag");
    if (response.headers.get("X-Converged") === "true") return;
    // Where a wait ended without a better frame, the solve is slow, or it has stopped short.
    if (same && wait !== "none") await new Promise((resolve) => { setTimeout(resolve, 1000); });
    wait = `max_error=${(Number(response.headers.get("X-Error-Estimate")) / 2).toPrecision(3)}`;
  }
}

const percent = (fraction) => `${(100 * fraction).toPrecision(2)} %`;

function fail(error) {
  if (error.name === "AbortError") return;
  if (error.status === 401) {
    element("guard").hidden = false;
    show("placeholder", "A token is needed.");
    return;
  }
  show("problem", error.message);
  element("problem").hidden = false;
  element("again").hidden = false;
}

function start() {
  element("guard").hidden = true;
  listScenes().then(() => open(element("sample").value)).catch(fail);
}

const reopen = () => open(element("sample").value).catch(fail);
element("sample").addEventListener("change", reopen);
element("restart").addEventListener("click", reopen);
element("enter").addEventListener("click", () => { token = element("token").value; start(); });
addEventListener("pagehide", end);
addEventListener("pageshow", (event) => { if (event.persisted) reopen(); });
start();
