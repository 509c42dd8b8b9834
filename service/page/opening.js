// New sessions: on a scene that ships with the service, or on a file.

import { call, Problem, send } from "./api.js";

const ENDPOINT = "/v1/sessions";

/** Media types of files that are posted as they are, by the end of their names. */
const MEDIA_TYPES = {
  glb: "model/gltf-binary",
  gltf: "model/gltf+json",
  obj: "model/obj",
  stl: "model/stl",
  mgf: "model/x-mgf",
  ies: "model/x-ies",
  zip: "application/zip",
};

/** What a file chooser offers. */
export const ACCEPTED = [".json", ...Object.keys(MEDIA_TYPES).map((ending) => `.${ending}`)].join(",");

export const openSample = (sample) => send("POST", ENDPOINT, { sample });

export const openScene = (scene) => send("POST", ENDPOINT, { scene });

/** A session on a dropped or chosen file. */
export async function openFile(file) {
  const ending = file.name.split(".").pop().toLowerCase();
  if (ending === "json") return openDocument(file);
  const type = MEDIA_TYPES[ending];
  if (!type) throw new Problem(415, { detail: `${file.name}: files that end in ${ACCEPTED} are read` });
  const name = file.name.slice(0, 200);
  const options = { method: "POST", headers: { "Content-Type": type }, body: file };
  const response = await call(`${ENDPOINT}?${new URLSearchParams({ name })}`, options);
  const answer = await response.json().catch(() => ({}));
  if (!response.ok) throw new Problem(response.status, answer);
  return answer;
}

async function openDocument(file) {
  let document;
  try {
    document = JSON.parse(await file.text());
  } catch (error) {
    throw new Problem(422, { detail: `${file.name}: ${error.message}` });
  }
  return document.scene ? send("POST", ENDPOINT, document) : openScene(document);
}
