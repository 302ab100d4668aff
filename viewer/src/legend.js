// What the colours mean. A legend is a list of parts: { title, colors, low, high } is a ramp, { title, entries } a list of colours, each as
// [color, text], and { title } only words.
import { byId, element, length, unitName } from './dom.js';
import { RAMP } from './point_colors.js';
import { EXACT_COLOR, HEIGHT_COLORS, LEVEL_COLORS, SLOPE_COLORS, STEEPEST_DEGREES, WATER_COLOR } from './surface.js';

// Returns a height of the scene in the source's unit.
function heightText(metres, { offset, metres: [, , inUnit] }, places = 1) {
  return `${(offset[2] + metres / inUnit).toFixed(places)} ${unitName(inUnit)}`.trim();
}

const rgb = (bytes) => `rgb(${bytes.join(' ')})`;

function levelList({ coarser, hasExact }) {
  const name = (level) => `level ${level}${level === 1 ? ', the coarsest' : ''}`;
  const levels = coarser.map((level) => [LEVEL_COLORS[(level - 1) % LEVEL_COLORS.length], name(level)]);
  return [{ title: 'Levels of detail', entries: hasExact ? [...levels, [EXACT_COLOR, 'exact, with every point']] : levels }];
}

function pointList({ classes, ramp: heights, isPlain }, georeference, hasWater) {
  if (classes) return [{ title: 'Classes', entries: classes.map(({ name, color }) => [rgb(color), name]) }];
  const water = hasWater ? [{ title: '', entries: [[WATER_COLOR, 'water']] }] : [];
  if (isPlain) return water;
  if (!heights) return [{ title: 'Recorded colours' }];
  // The colours tell heights to about a fiftieth of the whole.
  const places = heights[1] - heights[0] > 20 ? 0 : 1;
  const [low, high] = heights.map((height) => heightText(height, georeference, places));
  return [{ title: 'Height, about', colors: RAMP.map(rgb), low, high }, ...water];
}

// Tiles of `gdt-batch diff` say what their colours mean.
function differenceList({ range, threshold, unit, colors, unchanged, outside }) {
  const others = [[rgb(outside), 'only in the later terrain']];
  if (threshold > 0) others.unshift([rgb(unchanged), `less than ${threshold} ${unit}`]);
  return [{ title: `Difference (${unit})`, colors: colors.map(rgb), low: `cut ${range}`, high: `fill ${range}` }, { title: '', entries: others }];
}

// Returns the parts of the legend.
export function legendOf({ mode, terrain, heights, pointColors, exaggeration, dressing }) {
  const { georeference } = terrain;
  const heightEnds = () => heights.map((height) => heightText(height, georeference));
  const parts = {
    points: () => (terrain.difference ? differenceList(terrain.difference) : pointList(pointColors, georeference, dressing.hasWater)),
    height: () => [{ title: 'Height', colors: HEIGHT_COLORS, low: heightEnds()[0], high: heightEnds()[1] }],
    slope: () => [{ title: 'Slope', colors: SLOPE_COLORS, low: '0°', high: `${STEEPEST_DEGREES}° and more` }],
    levels: () => levelList(terrain.shownLevels),
    images: () => [],
  }[mode]();
  if (exaggeration !== 1) parts.push({ title: `Heights × ${exaggeration}` });
  return parts;
}

function elementsOf({ title, colors, low, high, entries = [] }) {
  const made = [element('div', { textContent: title })];
  if (colors) {
    const picture = element('div', { className: 'ramp' });
    picture.style.background = `linear-gradient(to right, ${colors.join(', ')})`;
    made.push(picture, element('div', { className: 'ends' }, element('span', { textContent: low }), element('span', { textContent: high })));
  }
  const lines = entries.map(([color, text]) => {
    const swatch = element('span');
    swatch.style.background = color;
    return element('li', {}, swatch, text);
  });
  if (lines.length) made.push(element('ul', {}, ...lines));
  return made;
}

export function showLegend(viewer) {
  const parts = legendOf(viewer);
  byId('legend').hidden = parts.length === 0;
  byId('legend').replaceChildren(...parts.flatMap(elementsOf));
}

// Returns what the panel says of a place: pairs of a term and a value.
export function pointFacts(found, georeference, isFinal) {
  const level = found.isExact ? 'exact, with every point' : `level ${found.level}, coarser by up to ${length(found.error)}`;
  const [flat, , up] = georeference.metres.map(unitName);
  const term = (name, unit) => (unit ? `${name} (${unit})` : name);
  return [
    [term('x', flat), found.text[0]],
    [term('y', flat), found.text[1]],
    [term('z', up), found.text[2]],
    ['nearest corner', found.isExact ? `${found.vertex.join(', ')} (${length(found.vertexMetres)} away)` : null],
    ['class of that corner', found.isExact ? found.classification : null],
    ['intensity of that corner', found.isExact ? found.intensity : null],
    ['tile', found.uri],
    ['level', isFinal ? level : `${level}; loading the exact tile…`],
  ];
}
