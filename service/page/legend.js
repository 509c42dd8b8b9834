// The scale of false colours, in lux.

import { stops } from "./colours.js";

const MARKS = 5;

const tidy = (lux) => (lux >= 100 ? Math.round(lux) : Number(lux.toPrecision(2))).toLocaleString();

/** Show the scale from 0 to `maximum` lux, or none where it is null. */
export function showLegend(figure, maximum) {
  figure.hidden = maximum === null;
  if (maximum === null) return;
  const canvas = figure.querySelector("canvas");
  const pen = canvas.getContext("2d");
  const gradient = pen.createLinearGradient(0, 0, canvas.width, 0);
  for (const [at, colour] of stops) gradient.addColorStop(at, colour);
  pen.fillStyle = gradient;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  const marks = figure.querySelector("ol");
  marks.replaceChildren(...Array.from({ length: MARKS }, (_, k) => {
    const item = document.createElement("li");
    item.textContent = tidy((maximum * k) / (MARKS - 1));
    return item;
  }));
}
