// npm ci && node build.mjs [FOLDER]; node_modules may be deleted afterwards.
// Bundles three and Spark once, with their licences, for a page that asks nothing of the network.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { build } from "esbuild";

const PAGE = process.argv[2] ?? join(import.meta.dirname, "../../rein3d_jax/report/viewer_page");
const LIBRARIES = ["@sparkjsdev/spark", "three", "fflate"];

const { outputFiles } = await build({
  entryPoints: ["libraries.mjs"], bundle: true, minify: true, format: "iife", globalName: "libraries",
  target: "es2022", charset: "utf8", legalComments: "none", write: false,
});
// The page holds the bundle in a <script>: nothing in it may look like the end of one, or like a comment.
const code = outputFiles[0].text.replace(/<(?=\/script|!--|script)/gi, "\\x3c");
writeFileSync(join(PAGE, "bundle.js"), code);

const texts = LIBRARIES.map((name) => {
  const { version, license } = JSON.parse(readFileSync(`node_modules/${name}/package.json`, "utf8"));
  return `${name} ${version} (${license})\n\n${readFileSync(`node_modules/${name}/LICENSE`, "utf8").trim()}\n`;
});
writeFileSync(join(PAGE, "LICENCES.txt"), texts.join("\n" + "-".repeat(80) + "\n\n"));
console.log(`bundle.js: ${(code.length / 1e6).toFixed(2)} MB`);
