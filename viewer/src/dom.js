// Small helpers for the page.

export const byId = (id) => document.getElementById(id);

// Returns a new element with these properties and children.
export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

// Lets the browser save a file.
export function save(blob, name) {
  const url = URL.createObjectURL(blob);
  element('a', { href: url, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}

// Returns rows of a list of terms: [term, value] each, those without a value left out.
export function rows(pairs) {
  const present = pairs.filter(([, value]) => value !== null && value !== undefined && value !== '');
  return present.flatMap(([term, value]) => [element('dt', { textContent: term }), element('dd', {}, value)]);
}

export const count = (number) => number.toLocaleString('en');

export function bytes(number) {
  const units = ['B', 'KiB', 'MiB', 'GiB', 'TiB'];
  const power = Math.min(Math.floor(Math.log2(Math.max(number, 1)) / 10), units.length - 1);
  const value = number / 1024 ** power;
  return `${value.toFixed(value < 10 && power > 0 ? 1 : 0)} ${units[power]}`;
}

export function duration(seconds) {
  if (seconds < 1) return `${Math.round(seconds * 1000)} ms`;
  if (seconds < 60) return `${seconds.toFixed(1)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes} min ${Math.round(seconds % 60)} s`;
  return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

// Returns a length in metres as text.
export function length(metres) {
  const size = Math.abs(metres);
  if (size >= 10000) return `${(metres / 1000).toFixed(2)} km`;
  return `${metres.toFixed(size < 1 ? 3 : 2)} m`;
}

// Returns the short name of a unit of so many metres, or an empty text.
export function unitName(metres) {
  if (metres === 1) return 'm';
  if (metres === 0.3048) return 'ft';
  return Math.abs(metres - 1200 / 3937) < 1e-9 ? 'US ft' : '';
}
