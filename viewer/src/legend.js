// What the colours mean.
import { byId, element, length, unitName } from './dom.js';
import { EXACT_COLOR, HEIGHT_COLORS, LEVEL_COLORS, SLOPE_COLORS, STEEPEST_DEGREES } from './surface.js';

function ramp(title, colors, low, high) {
  const picture = element('div', { className: 'ramp' });
  picture.style.background = `linear-gradient(to right, ${colors.join(', ')})`;
  const ends = element('div', { className: 'ends' }, element('span', { textContent: low }), element('span', { textContent: high }));
  return [element('div', { textContent: title }), picture, ends];
}

// Returns a height of the scene in the source's unit.
function heightText(metres, { offset, metres: [, , inUnit] }) {
  return `${(offset[2] + metres / inUnit).toFixed(1)} ${unitName(inUnit)}`.trim();
}

function levelList({ coarser, hasExact }) {
  const line = (color, text) => {
    const swatch = element('span');
    swatch.style.background = color;
    return element('li', {}, swatch, text);
  };
  const name = (level) => `level ${level}${level === 1 ? ', the coarsest' : ''}`;
  const lines = coarser.map((level) => line(LEVEL_COLORS[(level - 1) % LEVEL_COLORS.length], name(level)));
  return [element('div', { textContent: 'Levels of detail' }), element('ul', {}, ...lines, ...(hasExact ? [line(EXACT_COLOR, 'exact, with every point')] : []))];
}

export function showLegend(mode, terrain, [low, high]) {
  const { georeference } = terrain;
  const parts = {
    points: () => [],
    height: () => ramp('Height', HEIGHT_COLORS, heightText(low, georeference), heightText(high, georeference)),
    slope: () => ramp('Slope', SLOPE_COLORS, '0°', `${STEEPEST_DEGREES}° and more`),
    levels: () => levelList(terrain.shownLevels),
  }[mode]();
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
