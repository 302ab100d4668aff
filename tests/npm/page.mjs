// node page.mjs URL CHROMIUM STEPS.json: opens a page in a headless Chromium, does the steps, and prints as JSON what they gave, what the
// console said, and which addresses the page asked for. A step is one of
//   {"size": [width, height], "dark": bool}   the window
//   {"wait": "expression"}                    until it is true
//   {"click": [x, y]}, {"double": [x, y]}     in pixels of the window
//   {"key": "Enter"}                          to the element with the focus
//   {"run": "expression"}                     gives its value
//   {"shot": "file.png"}                      a picture of the window
// Chromium is driven through a pipe, so that nothing but it is needed.
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { spawn } from 'node:child_process';

const [url, chromium, stepsPath] = process.argv.slice(2);
const steps = JSON.parse(await readFile(stepsPath));
const PATIENCE_MS = 120_000;
const KEY_CODES = { Enter: 13, Home: 36, ArrowLeft: 37, ArrowUp: 38, ArrowRight: 39, ArrowDown: 40 };

const profile = await mkdtemp(join(tmpdir(), 'gdt-page-'));
const browser = spawn(chromium, [
  '--headless', '--no-sandbox', '--disable-gpu', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-quic',
  '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync', '--disable-dev-shm-usage',
  `--user-data-dir=${profile}`, '--remote-debugging-pipe', 'about:blank',
], { stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'] });
const [toBrowser, fromBrowser] = [browser.stdio[3], browser.stdio[4]];

const waiting = new Map();
const [complaints, requests] = [[], []];
const handlers = {
  'Runtime.exceptionThrown': ({ exceptionDetails: { exception, text } }) => complaints.push(exception?.description ?? text),
  'Runtime.consoleAPICalled': ({ type, args }) => {
    if (type === 'error') complaints.push(args.map(({ value, description }) => value ?? description).join(' '));
  },
  'Log.entryAdded': ({ entry }) => { if (entry.level === 'error') complaints.push(`${entry.text} ${entry.url ?? ''}`); },
  'Network.requestWillBeSent': ({ request }) => requests.push(request.url),
};
let [number, rest] = [0, ''];
fromBrowser.setEncoding('utf8').on('data', (text) => {
  const messages = (rest + text).split('\0');
  rest = messages.pop();
  for (const { id, method, params, result, error } of messages.map((message) => JSON.parse(message))) {
    if (id === undefined) handlers[method]?.(params);
    else if (error) waiting.get(id).reject(new Error(error.message));
    else waiting.get(id).resolve(result);
  }
});
function ask(method, params = {}, sessionId = undefined) {
  number += 1;
  toBrowser.write(`${JSON.stringify({ id: number, method, params, sessionId })}\0`);
  return new Promise((resolve, reject) => waiting.set(number, { resolve, reject }));
}

async function open() {
  const { targetId } = await ask('Target.createTarget', { url: 'about:blank' });
  const { sessionId } = await ask('Target.attachToTarget', { targetId, flatten: true });
  const tell = (method, params) => ask(method, params, sessionId);
  for (const domain of ['Page', 'Runtime', 'Log', 'Network']) await tell(`${domain}.enable`);
  return tell;
}

async function evaluate(tell, expression) {
  const { result, exceptionDetails } = await tell('Runtime.evaluate', { expression, awaitPromise: true, returnByValue: true });
  if (exceptionDetails) throw new Error(`${expression}: ${exceptionDetails.exception?.description}`);
  return result.value;
}

async function waitFor(tell, expression) {
  // While one page takes the place of another, there may be nothing to ask.
  for (const start = Date.now(); !await evaluate(tell, expression).catch(() => false);) {
    if (Date.now() - start > PATIENCE_MS) throw new Error(`in vain: ${expression}; ${complaints.join('; ')}`);
    await new Promise((resolve) => setTimeout(resolve, 100));
  }
}

async function resize(tell, [width, height], dark) {
  await tell('Emulation.setDeviceMetricsOverride', { width, height, deviceScaleFactor: 1, mobile: width < 700 });
  await tell('Emulation.setTouchEmulationEnabled', { enabled: width < 700 });
  await tell('Emulation.setEmulatedMedia', { features: [{ name: 'prefers-color-scheme', value: dark ? 'dark' : 'light' }] });
}

async function click(tell, [x, y], clickCount = 1) {
  for (const type of ['mousePressed', 'mouseReleased']) {
    await tell('Input.dispatchMouseEvent', { type, x, y, button: 'left', clickCount });
  }
}

async function press(tell, key) {
  const code = { key, windowsVirtualKeyCode: KEY_CODES[key] ?? key.toUpperCase().charCodeAt(0) };
  for (const type of ['keyDown', 'keyUp']) await tell('Input.dispatchKeyEvent', { type, ...code });
}

async function shoot(tell, path) {
  const { data } = await tell('Page.captureScreenshot', { format: 'png' });
  await writeFile(path, Buffer.from(data, 'base64'));
}

async function take(tell, step, values) {
  if (step.size) await resize(tell, step.size, step.dark);
  if (step.open) await tell('Page.navigate', { url });
  if (step.wait) await waitFor(tell, step.wait);
  if (step.click) await click(tell, step.click);
  for (const number of step.double ? [1, 2] : []) await click(tell, step.double, number);
  if (step.key) await press(tell, step.key);
  if (step.run) values.push(await evaluate(tell, step.run) ?? null);
  if (step.shot) await shoot(tell, step.shot);
}

const timer = setTimeout(() => { console.error('the steps take too long'); browser.kill('SIGKILL'); process.exit(1); }, 2 * PATIENCE_MS);
try {
  const tell = await open();
  const values = [];
  for (const step of [steps[0], { open: true }, ...steps.slice(1)]) await take(tell, step, values);
  console.log(JSON.stringify({ values, complaints, requests }));
} catch (error) {
  console.error(error.message);
  process.exitCode = 1;
} finally {
  clearTimeout(timer);
  const ended = new Promise((resolve) => browser.once('exit', resolve));
  browser.kill('SIGKILL');
  await ended;
  await rm(profile, { recursive: true, force: true, maxRetries: 5 });
}
