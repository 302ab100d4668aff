// The report of the job, report.json, for people.
import { bytes, count, duration, element, rows } from './dom.js';

// Returns a bar that begins and ends at shares of its whole width.
function bar(from, to, label) {
  const fill = element('span', { className: 'fill' });
  fill.style.marginLeft = `${100 * Math.min(from, 1)}%`;
  fill.style.width = `${100 * Math.max(Math.min(to, 1) - from, 0.004)}%`;
  return element('span', { className: 'bar', title: label }, fill);
}

function stages({ stages: list = [], wall_s: whole }) {
  const span = Math.max(whole, ...list.map(({ start_s: start, wall_s: wall }) => start + wall), 1e-9);
  const lines = list.map(({ stage, start_s: start, wall_s: wall }) => element(
    'li',
    {},
    element('span', { className: 'name', textContent: stage }),
    bar(start / span, (start + wall) / span, `${stage}: ${duration(wall)}, from ${duration(start)} on`),
    element('span', { className: 'value', textContent: duration(wall) }),
  ));
  return element('ul', { className: 'stages' }, ...lines);
}

function leftOut({ points, duplicates, skipped = [] }) {
  const kinds = [
    ['of other classes', points.other_class],
    ['outside the bounds', points.out_of_bounds],
    ['withheld', points.withheld],
    ['malformed', points.malformed],
    ['with the x and y of another', duplicates],
  ].filter(([, number]) => number > 0);
  if (skipped.length) kinds.push(['files left out', skipped.length]);
  return kinds.map(([what, number]) => `${count(number)} ${what}`).join(', ') || 'none';
}

// With max_error, only some points are vertices, and the others are near the mesh.
function vertices({ sites, selection }) {
  return selection ? `${count(sites)} of ${count(selection.points)} points; the others are within ${selection.greatest_error.toPrecision(3)}` : count(sites);
}

const SURFACES = {
  all: 'all points, with any trees and buildings',
  ground: 'points of the ground and of water',
  'bare-earth': 'the ground, found by the program',
  first: 'first returns, with roofs and tree tops',
  last: 'last returns',
};

// Which points the surface is of, and the option that chose them.
function surface({ input }) {
  if (!input) return null;
  const { surface: name, classes } = input;
  return Array.isArray(classes) ? `points of the classes ${classes.join(', ')}` : `${SURFACES[name] ?? name} (surface = "${name}")`;
}

function rasters(raster) {
  if (!raster) return null;
  const [columns, lines] = raster.size;
  return `${raster.products.join(', ')}: ${count(columns)} × ${count(lines)} cells, ${bytes(raster.bytes)}`;
}

const section = (title, ...children) => element('section', {}, element('h3', { textContent: title }), ...children);

// Returns what the panel shows of a report, or of none.
export function describeReport(report) {
  if (!report) return [element('p', { textContent: 'There is no report.json beside the terrain.' })];
  const { warnings = [] } = report;
  const warned = warnings.length
    ? element('ul', { className: 'warnings' }, ...warnings.map((text) => element('li', { textContent: text })))
    : element('p', { textContent: 'none' });
  const facts = element('dl', {}, ...rows([
    ['points read', count(report.points.read)],
    ['points left out', leftOut(report)],
    ['surface', surface(report)],
    ['classes', report.surface],
    ['vertices', vertices(report)],
    ['triangles', count(report.triangles)],
    ['tiles', count(report.tiles)],
    ['coarser tiles', report.levels?.files ? count(report.levels.files) : null],
    ['source', `${count(report.files)} ${report.files === 1 ? 'file' : 'files'}, unit ${report.unit}`],
    ['CRS', report.crs],
    ['lattice', report.lattice ? `${report.lattice.resolution} in x and y, ${report.lattice.resolution_z} in z` : null],
    ['rasters', rasters(report.raster)],
    ['breaklines', report.breaklines?.features ? `${count(report.breaklines.features)} features` : null],
    ['written', bytes(report.bytes_written)],
  ]));
  const memory = bar(0, report.peak_memory / report.memory_limit, 'share of the limit');
  return [
    section(`Warnings (${warnings.length})`, warned),
    section('What it holds', facts),
    section(`Stages: ${duration(report.wall_s)} on ${report.threads} ${report.threads === 1 ? 'thread' : 'threads'}`, stages(report)),
    section(`Memory: ${bytes(report.peak_memory)} of ${bytes(report.memory_limit)}`, memory),
    element('p', { className: 'small', textContent: `Written by ${report.generator}` }),
  ];
}
