// Linear light and the sRGB that screens show.

export const toCode = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);
export const toLinear = (x) => (x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4);

const byte = (x) => Math.round(255 * Math.max(0, Math.min(1, toCode(x))));

/** #rrggbb of a linear triple. */
export const toHex = (rgb) => `#${rgb.map((x) => byte(x).toString(16).padStart(2, "0")).join("")}`;

/** The linear triple of #rrggbb. */
export const fromHex = (hex) => [1, 3, 5].map((at) => toLinear(parseInt(hex.slice(at, at + 2), 16) / 255));

// Every tenth of viridis, in which the service draws false colours.
const VIRIDIS = [
  [68, 1, 84], [72, 36, 117], [65, 68, 135], [53, 95, 141], [42, 120, 142], [33, 145, 140],
  [34, 168, 132], [68, 191, 112], [122, 209, 81], [189, 223, 38], [253, 231, 37],
];

/** Colours of a legend as stops of a gradient, from nothing to its end. */
export const stops = VIRIDIS.map((rgb, at) => [at / (VIRIDIS.length - 1), `rgb(${rgb.join(" ")})`]);
