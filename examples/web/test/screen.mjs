// How long the page takes: from a cold start to the first picture, from the hand to the screen, stage by stage, and a page that only clears
// its canvas, which is the browser's own share.
//
//   node test/screen.mjs PATH_OF_VR [SECONDS]
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { launch, serve } from "./page.mjs";

const [program, seconds = "10"] = process.argv.slice(2);
const SIZE = { width: 640, height: 480 };
const rank = (times, share) => times.toSorted((a, b) => a - b)[Math.min(times.length - 1, Math.floor(share * times.length))] ?? NaN;
const shown = (name, times) =>
  console.log(`${name.padEnd(44)} ${rank(times, 0.5).toFixed(0).padStart(6)} ${rank(times, 0.95).toFixed(0).padStart(6)}   ${times.length}`);

const browser = await launch();
const scratch = await mkdtemp(join(tmpdir(), "paintcopter-screen-"));
console.log(`${"milliseconds".padEnd(44)} median   95 %   of`);

// A canvas that is only cleared: from a key to the frame after it.
const empty = await browser.newPage({ viewport: SIZE });
await empty.setContent("<style>body{margin:0}canvas{width:100vw;height:100vh}</style><canvas width=640 height=480></canvas>");
const cleared = await empty.evaluate((lasts) => new Promise((resolve) => {
  const gl = document.querySelector("canvas").getContext("webgl2");
  const frames = [];
  let last = 0;
  const begun = performance.now();
  const frame = (time) => {
    if (last > 0) frames.push(time - last);
    last = time;
    gl.clearColor(Math.random(), 0.5, 0.5, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    if (performance.now() - begun < lasts) requestAnimationFrame(frame);
    else resolve(frames);
  };
  requestAnimationFrame(frame);
}), 3000);
shown("frame of a page that only clears", cleared);
await empty.close();

// Cold: a browser context has no cache of another.
const server = await serve(program, join(scratch, "out"), "--offline");
const starts = { first: [], wall: [] };
for (let k = 0; k < 5; k++) {
  const context = await browser.newContext({ viewport: SIZE });
  const page = await context.newPage();
  await page.goto(server.address);
  await page.waitForFunction(() => window.paintcopter?.first.drawn > 0);
  const first = await page.evaluate(() => window.paintcopter.first);
  starts.wall.push(first.surface);
  starts.first.push(first.drawn);
  await context.close();
  await new Promise((resolve) => setTimeout(resolve, 300));
}
shown("cold start to the surface's arrival", starts.wall);
shown("cold start to the first picture of it", starts.first);

const page = await browser.newPage({ viewport: SIZE });
await page.goto(server.address);
await page.waitForFunction(() => window.paintcopter?.first.drawn > 0);
await page.waitForTimeout(1500);
await page.evaluate(() => window.paintcopter.delays.clear());
await page.mouse.move(200, 200);
await page.mouse.down();
const end = Date.now() + 1000 * Number(seconds);
for (let k = 0; Date.now() < end; k++) {
  await page.mouse.move(320 + 120 * Math.cos(k / 12), 220 + 60 * Math.sin(k / 12));
  await page.waitForTimeout(8);
}
await page.mouse.up();
const stages = await page.evaluate(() => window.paintcopter.delays.stages);
for (const [name, times] of Object.entries(stages)) shown(name, times);
await page.evaluate(() => document.getElementById("end").click());
await server.ended;
await browser.close();
await rm(scratch, { recursive: true, force: true });
