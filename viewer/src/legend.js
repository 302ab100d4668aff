// What the colours mean.
import { byId, element, length, unitName } from './dom.js';
import { RAMP } from './point_colors.js';
import { EXACT_COLOR, HEIGHT_COLORS, LEVEL_COLORS, SLOPE_COLORS, STEEPEST_DEGREES } from './surface.js';

function ramp(title, colors, low, high) {
  const picture = element('div', { className: 'ramp' });
  picture.style.background = `linear-gradient(to right, ${colors.join(', ')})`;
  const ends = element('div', { className: 'ends' }, element('span', { textContent: low }), element('span', { textContent: high }));
  return [element('div', { textContent: title }), picture, ends];
}

// Returns a height of the scene in the source's unit.
function heightText(metres, { offset, metres: [, , inUnit] }, places = 1) {
  return `${(offset[2] + metres / inUnit).toFixed(places)} ${unitName(inUnit)}`.trim();
}

const rgb = (bytes) => `rgb(${bytes.join(' ')})`;

// Returns a list of colours and what they stand for.
function list(title, entries) {
  const lines = entries.map(([color, text]) => {
    const swatch = element('span');
    swatch.style.background = color;
    return element('li', {}, swatch, text);
  });
  return [element('div', { textContent: title }), element('ul', {}, ...lines)];
}

function levelList({ coarser, hasExact }) {
  const name = (level) => `level ${level}${level === 1 ? ', the coarsest' : ''}`;
  const levels = coarser.map((level) => [LEVEL_COLORS[(level - 1) % LEVEL_COLORS.length], name(level)]);
  return list('Levels of detail', hasExact ? [...levels, [EXACT_COLOR, 'exact, with every point']] : levels);
}

// Colours that points were recorded with need no words.
function pointList({ classes, ramp: heights }, georeference) {
  if (classes) return list('Classes', classes.map(({ name, color }) => [rgb(color), name]));
  if (!heights) return [];
  // The colours tell heights to about a fiftieth of the whole.
  const places = heights[1] - heights[0] > 20 ? 0 : 1;
  return ramp('Height, about', RAMP.map(rgb), ...heights.map((height) => heightText(height, georeference, places)));
}

// Tiles of `gdt-batch diff` say what their colours mean.
function differenceList({ range, threshold, unit, colors, unchanged, outside }) {
  const others = [[rgb(outside), 'only in the later terrain']];
  if (threshold > 0) others.unshift([rgb(unchanged), `less than ${threshold} ${unit}`]);
  const scale = ramp(`Difference (${unit})`, colors.map(rgb), `cut ${range}`, `fill ${range}`);
  return [...scale, ...list('', others)];
}

export function showLegend({ mode, terrain, heights, pointColors, exaggeration }) {
  const { georeference } = terrain;
  const parts = {
    points: () => (terrain.difference ? differenceList(terrain.difference) : pointList(pointColors, georeference)),
    height: () => ramp('Height', HEIGHT_COLORS, ...heights.map((height) => heightText(height, georeference))),
    slope: () => ramp('Slope', SLOPE_COLORS, '0°', `${STEEPEST_DEGREES}° and more`),
    levels: () => levelList(terrain.shownLevels),
    images: () => [],
  }[mode]();
  if (exaggeration !== 1) parts.push(element('div', { className: 'small', textContent: `Heights × ${exaggeration}` }));
  byId('legend').hidden = parts.length === 0;
  byId('legend').replaceChildren(...parts);
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
