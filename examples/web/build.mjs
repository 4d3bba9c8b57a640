// Builds the page into dist/, or with --check says whether dist/ is what the sources build to.
import { build } from "esbuild";
import { readFile, writeFile, mkdir } from "node:fs/promises";
import { basename } from "node:path";

const options = { bundle: true, minify: true, format: "esm", target: "es2022", legalComments: "none", write: false, metafile: true };
// What both pages need is in a file of its own.
const script = await build({
  ...options, entryPoints: { app: "src/main.ts", design: "src/design.ts" }, splitting: true, outdir: "dist", chunkNames: "shared",
});
const scripts = Object.fromEntries(script.outputFiles.map(({ path, contents }) => [basename(path), Buffer.from(contents)]));
if (Object.keys(scripts).length !== 3) throw new Error(`the program serves app.js, design.js and shared.js, not ${Object.keys(scripts)}`);
// The page holds code of other projects: their licences go with it.
const packages = new Set(
  Object.keys(script.metafile.inputs).flatMap((path) => path.match(/^node_modules\/((?:@[^/]+\/)?[^/]+)/)?.[1] ?? []),
);
const licences = await Promise.all(
  [...packages].sort().map(async (name) => {
    const { version } = JSON.parse(await readFile(`node_modules/${name}/package.json`, "utf8"));
    return `${name} ${version}\n\n${(await readFile(`node_modules/${name}/LICENSE`, "utf8")).trim()}\n`;
  }),
);
const files = {
  ...scripts,
  "index.html": await readFile("src/index.html"),
  "style.css": await readFile("src/style.css"),
  "design.html": await readFile("src/design.html"),
  "design.css": await readFile("src/design.css"),
  "licences.txt": Buffer.from(licences.join("\n\n")),
};
let size = 0;
let stale = [];
await mkdir("dist", { recursive: true });
for (const [name, contents] of Object.entries(files)) {
  size += contents.length;
  if (process.argv.includes("--check")) {
    const shipped = await readFile(`dist/${name}`).catch(() => Buffer.alloc(0));
    if (!shipped.equals(contents)) stale.push(name);
  } else {
    await writeFile(`dist/${name}`, contents);
  }
}
console.log(`${(size / 1e6).toFixed(2)} MB`);
if (size > 1.5e6) throw new Error("the page must not be larger than 1.5 MB");
if (stale.length > 0) {
  console.error(`dist/ is not what the sources build to (${stale.join(", ")}): run \`npm run build\` and commit it`);
  process.exit(1);
}
