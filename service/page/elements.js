// The overlay of elements, from its table: each filled in its own colour, with its outline.

import { toHex } from "./colours.js";

const OUTLINE = "rgb(0 0 0 / 0.45)";

/** {facts, figures} of the answer to `overlays/mesh`. */
export function elementFigures({ corners, corner_count: counts, rgb, ...facts }) {
  const filled = { corners: 3, position: [], colour: [] };
  const lines = { corners: 2, position: [], colour: [] };
  corners.forEach((places, k) => {
    const count = counts[k];
    const colour = toHex(rgb[k]);
    for (let c = 2; c < count; c += 1) {
      filled.position.push(...places[0], ...places[c - 1], ...places[c]);
      filled.colour.push(colour);
    }
    for (let c = 0; c < count; c += 1) {
      lines.position.push(...places[c], ...places[(c + 1) % count]);
      lines.colour.push(OUTLINE);
    }
  });
  for (const figure of [filled, lines]) figure.position = Float32Array.from(figure.position);
  return { facts, figures: [filled, lines] };
}
