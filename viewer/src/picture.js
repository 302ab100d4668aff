// The view as a picture: the terrain as it is on the screen, with legend, scale bar and attribution.

const [EDGE, PAD, LINE, RAMP] = [12, 10, 18, 200];
const FONT = '13px system-ui, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
const [PAPER, INK] = ['#fffffff0', '#17212b'];

// Returns the lines of a legend with their heights, in pixels.
const linesOf = (parts) => parts.flatMap(({ title, colors, low, high, entries = [] }) => [
  ...(title ? [{ height: LINE, title }] : []),
  ...(colors ? [{ height: LINE, colors }, { height: LINE, low, high }] : []),
  ...entries.map(([color, text]) => ({ height: LINE, color, text })),
]);

function drawLine(pen, { title, colors, low, high, color, text }, left, top) {
  const middle = top + LINE / 2;
  const write = (words, x, align = 'left') => {
    Object.assign(pen, { fillStyle: INK, textAlign: align });
    pen.fillText(words, x, middle);
  };
  if (colors) {
    const ramp = pen.createLinearGradient(left, 0, left + RAMP, 0);
    colors.forEach((stop, i) => ramp.addColorStop(i / (colors.length - 1), stop));
    pen.fillStyle = ramp;
    pen.fillRect(left, top + 3, RAMP, 12);
  } else if (color) {
    pen.fillStyle = color;
    pen.fillRect(left, top + 2, 14, 14);
    write(text, left + 22);
  } else if (title) {
    write(title, left);
  } else {
    write(low, left);
    write(high, left + RAMP, 'right');
  }
}

function drawLegend(pen, parts, height) {
  const lines = linesOf(parts);
  if (lines.length === 0) return;
  const widthOf = ({ title, text, colors }) => (colors ? RAMP : pen.measureText(title ?? text ?? '').width + (text ? 22 : 0));
  const width = Math.max(...lines.map(widthOf));
  const whole = lines.reduce((sum, line) => sum + line.height, 0);
  let top = height - EDGE - PAD - whole;
  pen.fillStyle = PAPER;
  pen.fillRect(EDGE, top - PAD, width + 2 * PAD, whole + 2 * PAD);
  for (const line of lines) {
    drawLine(pen, line, EDGE + PAD, top);
    top += line.height;
  }
}

function drawScale(pen, { pixels, text }, right, bottom) {
  pen.fillStyle = PAPER;
  pen.fillRect(right - pixels - 2 * PAD, bottom - 34, pixels + 2 * PAD, 34);
  pen.fillStyle = INK;
  pen.textAlign = 'center';
  pen.fillText(text, right - PAD - pixels / 2, bottom - 22);
  pen.fillRect(right - PAD - pixels, bottom - 10, pixels, 3);
}

// Returns a picture as a PNG. `canvas` has just been drawn, with `ratio` pixels for each of the window; `sky` are the colours behind it from the
// top on; `words` stand in the lower right corner, in the colour `ink`.
export function pictureOf({ canvas, ratio, sky, parts, bar, words, ink }) {
  const picture = Object.assign(document.createElement('canvas'), { width: canvas.width, height: canvas.height });
  const pen = picture.getContext('2d');
  const background = pen.createLinearGradient(0, 0, 0, canvas.height);
  sky.forEach((color, i) => background.addColorStop(i / Math.max(sky.length - 1, 1), color));
  pen.fillStyle = background;
  pen.fillRect(0, 0, canvas.width, canvas.height);
  pen.drawImage(canvas, 0, 0);
  pen.scale(ratio, ratio);
  Object.assign(pen, { font: FONT, textBaseline: 'middle' });
  const [width, height] = [canvas.width / ratio, canvas.height / ratio];
  drawLegend(pen, parts, height);
  const hasWords = words !== '';
  if (bar) drawScale(pen, bar, width - EDGE, height - EDGE - (hasWords ? LINE + 4 : 0));
  if (hasWords) {
    Object.assign(pen, { fillStyle: ink, textAlign: 'right' });
    pen.fillText(words, width - EDGE, height - EDGE);
  }
  return new Promise((resolve, reject) => {
    picture.toBlob((blob) => (blob ? resolve(blob) : reject(new Error('the browser makes no picture of this size'))), 'image/png');
  });
}
