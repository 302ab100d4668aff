// What the page shows, in its address: a link shows the same.

const SAVE_MS = 500;

// Returns numbers as a short text, and the numbers of such a text, or null if there are not so many.
export const writeNumbers = (numbers, digits) => numbers.map((number) => String(Number(number.toFixed(digits)))).join(',');
export function readNumbers(text, length) {
  const numbers = (text ?? '').split(',').map(Number);
  return text && numbers.length === length && numbers.every(Number.isFinite) ? numbers : null;
}

export class Link {
  // `write` returns what is shown now: texts by name, without what is as usual. `read` shows what an address says.
  constructor(write, read) {
    Object.assign(this, { write, read, isOn: false });
    window.addEventListener('hashchange', () => this.open());
  }

  // Shows what the address says, and keeps it up to date from now on.
  open() {
    this.read(readLink());
    this.isOn = true;
    this.saved = this.text();
  }

  text() {
    return linkText(this.write());
  }

  // Something may have changed. Browsers limit how often the address may change. It takes the place of the one before, so that the way back does not
  // lead through all views.
  changed() {
    if (!this.isOn) return;
    this.timer ??= setTimeout(() => {
      this.timer = null;
      this.save();
    }, SAVE_MS);
  }

  save() {
    const text = this.text();
    if (text === this.saved) return;
    this.saved = text;
    history.replaceState(null, '', text ? `#${text}` : location.pathname + location.search);
  }
}

// Returns what the address says: texts by name.
export function readLink() {
  return Object.fromEntries(new URLSearchParams(location.hash.slice(1)));
}

// Returns texts by name as the part of an address. Commas and what templates of URLs have stay readable.
function linkText(values) {
  const text = new URLSearchParams(Object.entries(values)).toString();
  return text.replace(/%(2C|2F|3A|7B|7D)/g, decodeURIComponent);
}
