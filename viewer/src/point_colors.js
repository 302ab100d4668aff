// What the colours of the vertices stand for. Tiles do not say it; but the program has one ramp for heights and one table for classes
// (crates/tiles/src/color.rs), and its colours are told apart from all others by these.
import { Color } from 'three';

export const RAMP = [[70, 120, 96], [112, 158, 104], [178, 190, 122], [222, 206, 148], [196, 156, 110], [160, 124, 104], [244, 242, 238]];
const CLASSES = [
  ['never classified', 170, 170, 170], ['unclassified', 190, 190, 190], ['ground', 166, 124, 82], ['low vegetation', 160, 200, 110],
  ['medium vegetation', 96, 168, 80], ['high vegetation', 44, 122, 60], ['building', 214, 96, 72], ['low noise', 240, 60, 200],
  ['model key point', 222, 196, 120], ['water', 72, 132, 204], ['rail', 120, 110, 130], ['road surface', 110, 110, 116],
  ['overlap', 200, 180, 160], ['wire guard', 236, 206, 70], ['wire conductor', 246, 174, 54], ['transmission tower', 150, 80, 150],
  ['wire connector', 250, 130, 40], ['bridge deck', 150, 140, 150], ['high noise', 255, 40, 160], ['overhead structure', 130, 150, 170],
  ['ignored ground', 120, 90, 60], ['snow', 226, 236, 246], ['temporal exclusion', 200, 150, 200], ['other', 150, 160, 180],
];
// Tiles may hold colours in eight linear bits: dark ones are some steps off.
const NEAR = 6;
const MOST_OTHERS = 0.02;

const gap = (a, b) => Math.max(...a.map((value, k) => Math.abs(value - b[k])));

// Returns the place of a colour on the ramp from 0 to 1, or null if it is not on it.
function placeOnRamp(color) {
  let best = { distance: NEAR, place: null };
  for (let i = 0; i + 1 < RAMP.length; i += 1) {
    const way = RAMP[i + 1].map((value, k) => value - RAMP[i][k]);
    const along = color.reduce((sum, value, k) => sum + (value - RAMP[i][k]) * way[k], 0) / way.reduce((sum, value) => sum + value * value, 0);
    const share = Math.min(Math.max(along, 0), 1);
    const distance = gap(color, way.map((value, k) => RAMP[i][k] + share * value));
    if (distance < best.distance) best = { distance, place: (i + share) / (RAMP.length - 1) };
  }
  return best.place;
}

// Returns the heights at both ends of the ramp, or null if the colours are not those of heights.
function rampOf(samples) {
  const places = samples.map(({ height, color }) => ({ height, place: placeOnRamp(color) }));
  if (places.filter(({ place }) => place === null).length > MOST_OTHERS * places.length) return null;
  const inside = places.filter(({ place }) => place > 0.02 && place < 0.98);
  const mean = (of) => inside.reduce((sum, sample) => sum + of(sample), 0) / inside.length;
  const [height, place] = [mean((sample) => sample.height), mean((sample) => sample.place)];
  const perPlace = mean((sample) => (sample.height - height) * (sample.place - place)) / mean((sample) => (sample.place - place) ** 2);
  return perPlace > 0 ? [height - place * perPlace, height + (1 - place) * perPlace] : null;
}

// Returns the classes whose colours are there, or null if other colours are.
function classesOf(samples) {
  const seen = new Set();
  for (const { color } of samples) {
    const found = CLASSES.find(([, ...own]) => gap(color, own) < NEAR);
    if (!found) return null;
    seen.add(found);
  }
  return CLASSES.filter((entry) => seen.has(entry)).map(([name, ...color]) => ({ name, color }));
}

// Returns what the colours of samples, see `Dressing.samples`, stand for: `ramp` are the heights at its ends, `classes` have name and colour, and
// `isPlain` says that there are no colours.
export function describeColors(samples) {
  const color = new Color();
  const bytes = ([r, g, b]) => color.setRGB(r, g, b).convertLinearToSRGB().toArray().map((value) => 255 * value);
  const colored = samples.filter((sample) => sample.color).map((sample) => ({ height: sample.height, color: bytes(sample.color) }));
  if (colored.length === 0) return { isPlain: true };
  return { ramp: rampOf(colored), classes: classesOf(colored) };
}
