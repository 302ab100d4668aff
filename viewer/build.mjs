// Makes one file of the page, dist/index.html. It has everything inside (styles, scripts, the meshopt decoder, licences), so that it
// works offline and from any web server.
import { createHash } from 'node:crypto';
import { mkdir, readdir, readFile, writeFile } from 'node:fs/promises';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { build } from 'esbuild';

const here = dirname(fileURLToPath(import.meta.url));
const at = (path) => join(here, path);

async function bundle(entry) {
  const { outputFiles, metafile } = await build({
    entryPoints: [at(entry)],
    absWorkingDir: here,
    bundle: true,
    minify: true,
    format: 'esm',
    target: 'es2022',
    legalComments: 'none',
    write: false,
    metafile: true,
  });
  const [output] = Object.values(metafile.outputs);
  const inputs = Object.entries(output.inputs).filter(([, { bytesInOutput }]) => bytesInOutput > 0);
  return { text: outputFiles[0].text.trim(), inputs: inputs.map(([path]) => path) };
}

// The packages that parts of the page come from.
function packagesOf(inputs) {
  const names = inputs.map((path) => /node_modules\/((?:@[^/]+\/)?[^/]+)\//.exec(path)?.[1]);
  return [...new Set(names.filter(Boolean))].sort();
}

async function licenceOf(name) {
  const folder = at(`node_modules/${name}`);
  const { version } = JSON.parse(await readFile(join(folder, 'package.json')));
  const file = (await readdir(folder)).find((entry) => /^licen[cs]e/i.test(entry));
  if (!file) throw new Error(`${name} has no licence file`);
  return `${name} ${version}\n\n${(await readFile(join(folder, file), 'utf8')).trim()}`;
}

// three.js has this decoder among its examples, under a licence of its own.
async function decoderLicence() {
  const decoder = await readFile(at('node_modules/three/examples/jsm/libs/meshopt_decoder.module.js'), 'utf8');
  const copyright = /Copyright.*/.exec(decoder)?.[0];
  if (!copyright) throw new Error('the meshopt decoder does not say whose it is');
  const mit = (await readFile(at('node_modules/three/LICENSE'), 'utf8')).replace(/^[\s\S]*?(?=Permission is hereby)/, '');
  return `meshoptimizer (decoder)\n\nMIT License\n\n${copyright}\n\n${mit.trim()}`;
}

const escapeHtml = (text) => text.replace(/[&<>]/g, (sign) => ({ '&': '&amp;', '<': '&lt;', '>': '&gt;' })[sign]);
const digest = (text) => `'sha256-${createHash('sha256').update(text).digest('base64')}'`;

const [script, style] = [await bundle('src/main.js'), await bundle('src/style.css')];
const licences = [...(await Promise.all(packagesOf(script.inputs).map(licenceOf))), await decoderLicence()];
// Only what is in this file may run. Which hosts may be asked, src/hosts.js says: the page's own, and the one of the images that a user names. The
// decoder is WebAssembly; GLTFLoader reads blobs.
const policy = [
  "default-src 'none'",
  `script-src ${digest(script.text)} 'wasm-unsafe-eval'`,
  `style-src ${digest(style.text)}`,
  "connect-src 'self' blob: data: https: http:",
  "img-src 'self' blob: data:",
  "base-uri 'none'",
  "form-action 'none'",
].join('; ');
const parts = { POLICY: policy, STYLE: style.text, SCRIPT: script.text, LICENCES: escapeHtml(licences.join('\n\n\n')) };
const template = await readFile(at('src/index.html'), 'utf8');
const page = template.replace(/%([A-Z]+)%/g, (whole, name) => parts[name] ?? whole);
await mkdir(at('dist'), { recursive: true });
await writeFile(at('dist/index.html'), page);
console.log(`viewer/dist/index.html: ${(page.length / 1e6).toFixed(2)} MB, with ${packagesOf(script.inputs).join(', ')}`);
