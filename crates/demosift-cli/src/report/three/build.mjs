// Bundles three.js into three.bundle.js, and strips where the packages came from out of the lock file.
//
//     npm install && npm run build
import { readFileSync, writeFileSync, copyFileSync } from "node:fs";
import { build } from "esbuild";

await build({
  entryPoints: ["three.js"],
  outfile: "three.bundle.js",
  bundle: true,
  minify: true,
  treeShaking: true,
  format: "iife",
  globalName: "THREE",
  target: "es2022",
  legalComments: "inline",
});
copyFileSync("node_modules/three/LICENSE", "LICENSE-three.txt");

const lock = JSON.parse(readFileSync("package-lock.json", "utf8"));
for (const entry of Object.values(lock.packages)) delete entry.resolved;
writeFileSync("package-lock.json", `${JSON.stringify(lock, null, 2)}\n`);
