// Khronos' validator of GLB files: [{file, errors, warnings, messages}] as JSON. It knows no KHR_gaussian_splatting, so
// the extension's attributes get application-specific names of the same length; all else is checked as it is.
import fs from "node:fs";
import validator from "gltf-validator";

const found = [];
for (const file of process.argv.slice(2)) {
  const data = fs.readFileSync(file), length = data.readUInt32LE(12);
  const header = data.subarray(20, 20 + length).toString();
  data.write(header.replaceAll('"KHR_gaussian_splatting:', '"_HR_GAUSSIAN_SPLATTING_'), 20);
  const { issues } = await validator.validateBytes(new Uint8Array(data), { maxIssues: 20 });
  const messages = issues.messages.map(({ code, pointer }) => `${code} ${pointer}`);
  found.push({ file, errors: issues.numErrors, warnings: issues.numWarnings, messages });
}
console.log(JSON.stringify(found));
