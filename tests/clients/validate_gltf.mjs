// What Khronos' validator finds in each file: [{ file, numErrors, ..., messages }] on stdout.
// node validate_gltf.mjs NODE_MODULES FILE...
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';

const [modules, ...files] = process.argv.slice(2);
const validator = createRequire(`${modules}/`)('gltf-validator');
const found = [];
for (const file of files) {
  const bytes = new Uint8Array(readFileSync(file));
  const report = await validator.validateBytes(bytes, { maxIssues: 0 });
  found.push({ file, ...report.issues, info: report.info });
}
process.stdout.write(JSON.stringify(found));
