// node view.mjs OUTPUT CHROMIUM SCREENSHOT.png [PAGE [REQUEST.json]]: opens what a job wrote to the folder OUTPUT in a headless
// Chromium and prints as JSON what it shows: triangles, bounds, and the heights at the "places" of the request, a list of [x, y] in
// metres from the scene's origin. PAGE "view", the default, shows tileset.json with 3d-tiles-renderer and terrain.glb with
// GLTFLoader, both in three.js. PAGE "cesium" shows tileset.json on the globe with CesiumJS,
// and PAGE "terrain" shows terrain/ there, with imagery, or PAGE "quantized" in three.js: their request has "places" with heights, and "views".
import { createServer } from 'node:http';
import { mkdtemp, readFile, rm, writeFile } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import { dirname, extname, join, normalize } from 'node:path';
import { fileURLToPath } from 'node:url';
import { spawn } from 'node:child_process';

const [output, chromium, screenshot, page = 'view', requestPath] = process.argv.slice(2);
const here = dirname(fileURLToPath(import.meta.url));
const TYPES = { '.html': 'text/html', '.js': 'text/javascript', '.mjs': 'text/javascript', '.json': 'application/json', '.wasm': 'application/wasm' };
const PATIENCE_MS = 280_000;

let settle;
const shown = new Promise((resolve, reject) => { settle = { resolve, reject }; });

async function answer(request, response) {
  const path = normalize(decodeURIComponent(new URL(request.url, 'http://localhost').pathname));
  if (path === '/result') {
    const parts = [];
    for await (const part of request) parts.push(part);
    settle.resolve(JSON.parse(Buffer.concat(parts).toString()));
    return response.end();
  }
  if (path === '/request.json' && !requestPath) return response.end('{"places": []}');
  const file = path === '/request.json' ? requestPath : path.startsWith('/out/') ? join(output, path.slice(4)) : join(here, path);
  try {
    const bytes = await readFile(file);
    response.setHeader('Content-Type', TYPES[extname(file)] ?? 'application/octet-stream');
    if (extname(file) === '.terrain') response.setHeader('Content-Encoding', 'gzip');
    response.end(bytes);
  } catch {
    response.statusCode = 404;
    response.end();
  }
}

const server = createServer(answer).listen(0, '127.0.0.1');
await new Promise((resolve) => server.once('listening', resolve));
const profile = await mkdtemp(join(tmpdir(), 'gdt-view-'));
const browser = spawn(chromium, [
  '--headless', '--no-sandbox', '--disable-gpu', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--disable-quic',
  '--no-first-run', '--disable-background-networking', '--disable-component-update', '--disable-sync', '--disable-dev-shm-usage',
  `--user-data-dir=${profile}`, '--window-size=400,300', `http://127.0.0.1:${server.address().port}/${page}.html`,
], { stdio: ['ignore', 'ignore', 'pipe'] });
let said = '';
browser.stderr.on('data', (text) => { said = (said + text).slice(-4000); });
browser.once('exit', (code) => settle.reject(new Error(`the browser ended with ${code}: ${said}`)));
const timer = setTimeout(() => settle.reject(new Error(`nothing shown after ${PATIENCE_MS} ms: ${said}`)), PATIENCE_MS);
try {
  const { picture, ...result } = await shown;
  if (picture) await writeFile(screenshot, Buffer.from(picture.split(',')[1], 'base64'));
  console.log(JSON.stringify(result));
  process.exitCode = result.error ? 1 : 0;
} catch (error) {
  console.error(error.message);
  process.exitCode = 1;
} finally {
  clearTimeout(timer);
  browser.removeAllListeners('exit');
  const ended = new Promise((resolve) => browser.once('exit', resolve));
  browser.kill('SIGKILL');
  await ended;
  server.close();
  await rm(profile, { recursive: true, force: true, maxRetries: 5 });
}
