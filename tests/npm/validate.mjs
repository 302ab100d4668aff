// node validate.mjs PATH...: runs the Khronos glTF validator on every .glb file under the paths.
// Prints what the validator reports. The exit code is 1 after an error or a warning, or if there is no file.
import { readFile, readdir, stat } from 'node:fs/promises';
import { join } from 'node:path';
import validator from 'gltf-validator';

async function* glbFiles(path) {
  if ((await stat(path)).isDirectory()) {
    for (const name of (await readdir(path)).sort()) yield* glbFiles(join(path, name));
  } else if (path.endsWith('.glb')) {
    yield path;
  }
}

const SEVERITIES = ['error', 'warning', 'info', 'hint'];
const totals = [0, 0, 0, 0];
let files = 0;
for (const path of process.argv.slice(2)) {
  for await (const file of glbFiles(path)) {
    const report = await validator.validateBytes(new Uint8Array(await readFile(file)), { uri: file, maxIssues: 20 });
    files += 1;
    for (const { severity, code, pointer, message } of report.issues.messages) {
      totals[severity] += 1;
      console.log(`${file}: ${SEVERITIES[severity]} ${code} at ${pointer}: ${message}`);
    }
  }
}
console.log(`${files} files: ` + SEVERITIES.map((name, i) => `${totals[i]} ${name}s`).join(', '));
process.exitCode = files === 0 || totals[0] + totals[1] > 0 ? 1 : 0;
