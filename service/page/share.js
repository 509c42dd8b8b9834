// The page's address: it names the session and the view, so that a link, or a reload, restores both.

const NUMBERS = ["exposure", "scale_maximum"];
const DEFAULTS = { renderer: "", layer: "radiance", exposure: "auto", tone_map: "linear", scale_maximum: "auto" };

/** What the address says: {session, camera, settings, overlays, token, scene}. */
export function readAddress() {
  const fragment = new URLSearchParams(location.hash.slice(1));
  const triple = (name) => {
    const parts = (fragment.get(name) ?? "").split(",").map(Number);
    return parts.length === 3 && parts.every(Number.isFinite) ? parts : null;
  };
  const [eye, target, up] = ["eye", "target", "up"].map(triple);
  const fov = Number(fragment.get("fov"));
  const settings = { ...DEFAULTS };
  for (const name of Object.keys(DEFAULTS)) {
    const text = fragment.get(name);
    if (text === null) continue;
    settings[name] = NUMBERS.includes(name) && text !== "auto" ? Number(text) : text;
  }
  return {
    session: /^[\w-]+$/.test(fragment.get("session") ?? "") ? fragment.get("session") : null,
    camera: eye && target && up ? { eye, target, up, ...(fov > 0 && fov < 180 && { vertical_fov: fov }) } : null,
    settings,
    overlays: (fragment.get("overlays") ?? "").split(",").filter(Boolean),
    token: fragment.get("token"),
    scene: new URLSearchParams(location.search).get("scene"),
  };
}

/** The address of a session as it is looked at. Nothing secret is in it. */
export function addressOf(session, camera, settings, overlays) {
  const short = (vector) => vector.map((part) => Number(part.toPrecision(7))).join(",");
  const fragment = new URLSearchParams({ session: session.id });
  if (camera) {
    fragment.set("eye", short(camera.eye));
    fragment.set("target", short(camera.target));
    fragment.set("up", short(camera.up));
    fragment.set("fov", String(Number(camera.fov.toPrecision(6))));
  }
  for (const [name, value] of Object.entries(settings)) {
    if (value !== DEFAULTS[name]) fragment.set(name, value);
  }
  if (overlays.length) fragment.set("overlays", overlays.join(","));
  return `${location.origin}${location.pathname}#${fragment.toString().replaceAll("%2C", ",")}`;
}
