// How the solve goes: state, progress, the error estimate as a curve, counts, warnings, the change log.

const SVG = "http://www.w3.org/2000/svg";
const WIDTH = 300;
const HEIGHT = 90;
const KEPT = 600; // points of the curve
const SHOWN = 40; // newest entries of the log

export function percent(fraction) {
  return Number.isFinite(fraction) ? `${Number((100 * fraction).toPrecision(2))}\u00a0%` : "unknown";
}

const STATES = {
  solving: (tolerance) => `Solving to ${tolerance}`,
  converged: (tolerance) => `Converged to ${tolerance}`,
  paused: () => "Stopped at a limit",
  failed: () => "The solve failed",
};

/** The error estimate over time, falling from edit to edit. */
export class Curve {
  #points = [];

  constructor(svg) {
    this.svg = svg;
    svg.setAttribute("viewBox", `0 0 ${WIDTH} ${HEIGHT}`);
    svg.setAttribute("preserveAspectRatio", "none");
  }

  clear() {
    this.#points = [];
    this.svg.replaceChildren();
  }

  add(status) {
    const { error_estimate: error, revision, state, settings } = status;
    const last = this.#points.at(-1);
    if (!(error > 0) || (last && last.error === error && last.revision === revision && state !== "solving")) return;
    this.#points.push({ at: performance.now() / 1000, error, revision });
    if (this.#points.length > KEPT) this.#points = this.#points.filter((_, k) => k % 2 === 1);
    this.#draw(settings.error_tolerance);
  }

  #draw(tolerance) {
    const errors = this.#points.map(({ error }) => Math.log10(error));
    const goal = Math.log10(tolerance);
    const top = Math.max(...errors, goal) + 0.1;
    const bottom = Math.min(...errors, goal) - 0.1;
    const start = this.#points[0].at;
    const span = Math.max(1, this.#points.at(-1).at - start);
    const x = (at) => ((at - start) / span) * WIDTH;
    const y = (log) => ((top - log) / (top - bottom)) * HEIGHT;
    const parts = [line("goal", `M0 ${y(goal)}H${WIDTH}`)];
    let path = "";
    this.#points.forEach(({ at, revision }, k) => {
      const isNew = k > 0 && this.#points[k - 1].revision !== revision;
      if (isNew) parts.push(line("edit", `M${x(at)} 0V${HEIGHT}`));
      path += `${k === 0 ? "M" : "L"}${x(at).toFixed(1)} ${y(errors[k]).toFixed(1)}`;
    });
    this.svg.replaceChildren(...parts, line("error", path));
  }
}

function line(name, path) {
  const made = document.createElementNS(SVG, "path");
  made.setAttribute("class", name);
  made.setAttribute("d", path);
  return made;
}

/** Tell a status; `find` gives the page's elements by their ids. */
export function showStatus(find, status) {
  const { state, progress, settings, statistics } = status;
  const tolerance = percent(settings.error_tolerance);
  find("progress").value = state === "converged" ? 1 : progress;
  find("state").textContent = (STATES[state] ?? (() => state))(tolerance);
  find("error").textContent = percent(status.error_estimate);
  for (const name of ["elements", "links", "interpolants"]) {
    find(name).textContent = statistics[name].toLocaleString();
  }
  find("seconds").textContent = `${statistics.seconds.toFixed(1)} s`;
  find("revision").textContent = status.revision;
  find("warnings").replaceChildren(...status.warnings.map((text) => {
    const item = document.createElement("li");
    item.textContent = text;
    return item;
  }));
}

const MARKS = { pending: "○", redistributing: "◐", settled: "●" };

/** The change log, newest first. */
export function showLog(list, summary, entries) {
  const open = entries.filter(({ state }) => state !== "settled").length;
  summary.textContent = entries.length === 0 ? "no changes" : `${entries.length - open} of ${entries.length} settled`;
  list.replaceChildren(...entries.slice(-SHOWN).reverse().map((entry) => {
    const item = document.createElement("li");
    item.dataset.state = entry.state;
    const energy = entry.state === "settled" ? "" : `, ${entry.energy_to_redistribute.toPrecision(2)} W to go`;
    item.textContent = `${MARKS[entry.state]} ${entry.op.replaceAll("_", " ")} ${entry.id}: ${entry.state}${energy}`;
    return item;
  }));
}
