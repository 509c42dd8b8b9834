// Calls of the service over HTTP. What is refused is thrown as a Problem.

export class Problem extends Error {
  constructor(status, { title = "", detail = "", errors = [] } = {}) {
    super(detail || title || `The service answered ${status}.`);
    this.status = status;
    this.errors = errors ?? [];
  }
}

const KEY = "halflight-token";

export const token = {
  get value() { return sessionStorage.getItem(KEY) ?? ""; },
  set value(text) { sessionStorage.setItem(KEY, text); },
};

/** The answer to a call, whatever its status. Rejects with TypeError where the service cannot be reached. */
export function call(path, options = {}) {
  const headers = { ...options.headers };
  if (token.value) headers.Authorization = `Bearer ${token.value}`;
  return fetch(path, { cache: "no-store", ...options, headers });
}

async function expectOk(response) {
  if (response.ok) return response;
  throw new Problem(response.status, await response.json().catch(() => ({})));
}

export async function get(path, query = {}, options = {}) {
  const text = new URLSearchParams(query).toString();
  return expectOk(await call(text ? `${path}?${text}` : path, options));
}

export const getJson = async (path, query, options) => (await get(path, query, options)).json();

export async function send(method, path, body) {
  const response = await expectOk(await call(path, {
    method,
    headers: { "Content-Type": "application/json" },
    body: JSON.stringify(body),
  }));
  return response.status === 204 ? null : response.json();
}

export const scenes = async () => (await getJson("/v1/scenes")).scenes;
export const statusOf = (id, options) => getJson(`/v1/sessions/${id}`, {}, options);
export const sceneOf = (id, options) => getJson(`/v1/sessions/${id}/scene`, {}, options);
export const logOf = (id, options) => getJson(`/v1/sessions/${id}/log`, {}, options);
export const configure = (id, settings) => send("PATCH", `/v1/sessions/${id}/settings`, settings);
export const pick = (id, camera, x, y) => getJson(`/v1/sessions/${id}/pick`, { ...camera.query, x, y });

export const end = (id) => call(`/v1/sessions/${id}`, { method: "DELETE", keepalive: true }).catch(() => {});
