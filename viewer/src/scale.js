// The scale bar: a round length, as long as it is on the screen in the middle of the picture.
import { MathUtils } from 'three';
import { byId, unitName } from './dom.js';

// The bar is at most this long, in pixels.
const LONGEST = 140;

// Returns the greatest of 1, 2, 5, 10, 20 ... that is at most `limit`.
export function roundBelow(limit) {
  const power = 10 ** Math.floor(Math.log10(limit));
  return power * [5, 2, 1].find((digit) => digit * power <= limit);
}

function scaleText(number, unit) {
  if (unit === 'm' && number >= 1000) return `${number / 1000} km`;
  if (unit === 'm' && number < 1) return `${Number((100 * number).toPrecision(1))} cm`;
  return `${Number(number.toPrecision(1))} ${unit}`;
}

// Returns the bar for a camera that looks at a place `distance` metres away: its length in pixels, and what it says, in the unit of the source.
export function scaleBar({ fov }, height, distance, metresPerUnit) {
  const metresPerPixel = (2 * distance * Math.tan(MathUtils.degToRad(fov / 2))) / height;
  const unit = unitName(metresPerUnit) || 'm';
  const inUnit = metresPerPixel / (unit === 'm' ? 1 : metresPerUnit);
  const number = roundBelow(LONGEST * inUnit);
  return { pixels: number / inUnit, text: scaleText(number, unit) };
}

// Shows a bar, or none.
export function showScale(bar) {
  byId('scale').hidden = !bar;
  if (!bar) return;
  byId('scale-bar').style.width = `${bar.pixels.toFixed(1)}px`;
  byId('scale-text').textContent = bar.text;
}
