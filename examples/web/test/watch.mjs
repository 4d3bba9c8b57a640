// `vr --watch` in a real browser: a running `scan --live`, and the recording of a mission of `paintcopter`.
//
//   node test/watch.mjs FOLDER_OF_BINARIES [FOLDER]      the folder gets screenshots
import assert from "node:assert/strict";
import { spawn } from "node:child_process";
import { mkdir, mkdtemp, readFile, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { changed, runAll, serve, shot } from "./page.mjs";
import { liveAddress, record } from "./wall_recording.mjs";

const [binaries, pictures] = process.argv.slice(2);
const scratch = await mkdtemp(join(tmpdir(), "paintcopter-watch-"));
if (pictures) await mkdir(pictures, { recursive: true });
// The part of the screen without panels.
const CLIP = { x: 0, y: 120, width: 640, height: 240 };

async function open(browser, server) {
  const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
  page.on("pageerror", (error) => {
    throw error;
  });
  await page.goto(server.address);
  await page.waitForFunction(() => window.paintcopter?.watch() && document.getElementById("dot").classList.contains("on"));
  // What is said comes and goes before the scene, and its pixels are not the scene's.
  await page.evaluate(() => (document.getElementById("notice").style.visibility = "hidden"));
  return page;
}

const counts = (page) => page.evaluate(() => window.paintcopter.watch().counts);

async function end(page, server) {
  await page.click("#end");
  assert.equal(await server.ended, 0, "vr ends well");
  await page.close();
  return JSON.parse(await readFile(join(server.out, "report.json"), "utf8"));
}

async function scan(browser) {
  const folder = join(scratch, "scan");
  await mkdir(folder);
  await record(folder);
  const options = ["--sequence", folder, "--out", join(folder, "out"), "--voxel", "0.02", "--threads", "1", "--live", "127.0.0.1:0"];
  const run = spawn(join(binaries, "scan"), options, { stdio: ["ignore", "ignore", "pipe"] });
  const over = new Promise((resolve) => run.once("exit", resolve));
  const server = await serve(join(binaries, "vr"), join(scratch, "watch-scan"), "--watch", await liveAddress(run));
  const page = await open(browser, server);
  await page.waitForFunction(() => window.paintcopter.watch().counts.entities > 20, null, { timeout: 30000 });
  await page.waitForTimeout(500);
  if (pictures) await page.screenshot({ path: join(pictures, "watch-scan.png") });
  // The same picture without the scene: the pixels in between are the map's.
  const mapped = await shot(page, CLIP);
  await page.evaluate(() => (window.paintcopter.watch().group.visible = false));
  await page.waitForTimeout(300);
  const seen = await changed(page, mapped, await shot(page, CLIP), 20);
  await page.evaluate(() => (window.paintcopter.watch().group.visible = true));
  assert.ok(seen > 10000, `the map is seen: ${seen} pixels changed`);
  assert.equal(await over, 0);
  await page.waitForFunction(() => /run is over|lost/.test(document.getElementById("notice").textContent), null, { timeout: 20000 });
  if (pictures) await page.screenshot({ path: join(pictures, "watch-scan.png") });
  const figures = await end(page, server);
  const report = JSON.parse(await readFile(join(folder, "out", "report.json")));
  assert.equal(figures.triangles, report.triangles, "what is shown is the map");
  assert.equal(figures.malformed_messages, 0);
  return `scan --live: ${seen} pixels changed, ${figures.triangles} triangles as in the run's report`;
}

async function mission(browser) {
  const folder = join(scratch, "mission");
  await mkdir(folder);
  await writeFile(join(folder, "wall.obj"), "v 0 0.5 1\nv 0 -0.5 1\nv 0 -0.5 1.6\nv 0 0.5 1.6\nf 1 2 3\nf 1 3 4\n");
  const options = ["--mesh", join(folder, "wall.obj"), "--up", "z", "--scale", "1", "--fill", "20", "--out", folder];
  const job = spawn(join(binaries, "paintcopter"), options, { stdio: "ignore" });
  assert.equal(await new Promise((resolve) => job.once("exit", resolve)), 0);
  const server = await serve(join(binaries, "vr"), join(scratch, "watch-mission"), "--watch", join(folder, "mission.mcap"));
  const page = await open(browser, server);
  const entities = (least) => page.waitForFunction((least) => window.paintcopter.watch().counts.entities >= least, least, { timeout: 60000 });
  await entities(3);
  await page.waitForTimeout(500);
  const bare = await shot(page, CLIP);
  // The robot flies at the speed at which it flew, and stands still in a pause.
  await page.waitForTimeout(2000);
  await page.keyboard.press("p");
  await page.waitForTimeout(1000);
  const [held, before] = [await shot(page, CLIP), await counts(page)];
  const flown = await changed(page, bare, held);
  assert.ok(flown > 200, `the robot moves: ${flown} pixels changed`);
  await page.waitForTimeout(1200);
  assert.deepEqual(await counts(page), before, "nothing comes in a pause");
  const moved = await changed(page, held, await shot(page, CLIP));
  assert.ok(moved < 20, `nothing moves in a pause: ${moved} pixels changed`);
  const clock = () => page.evaluate(() => parseFloat(document.getElementById("played").textContent));
  await page.keyboard.press("p");
  await page.waitForTimeout(500);
  const [from, begun] = [await clock(), Date.now()];
  await page.waitForTimeout(3000);
  const speed = (1000 * ((await clock()) - from)) / (Date.now() - begun);
  assert.ok(speed > 0.8 && speed < 1.2, `it plays at ${speed} times the speed`);
  await page.waitForFunction(() => [...window.paintcopter.watch().keys()].some((key) => key.startsWith("/paint ")), null, { timeout: 120000 });
  await page.waitForTimeout(6000);
  const traces = await page.evaluate(() => [...window.paintcopter.watch().keys()].filter((key) => key.startsWith("/paint ")).length);
  const painted = await changed(page, bare, await shot(page, CLIP));
  if (pictures) await page.screenshot({ path: join(pictures, "watch-mission.png") });
  assert.ok(painted > 600, `paint is seen: ${painted} pixels changed`);
  const figures = await end(page, server);
  assert.equal(figures.malformed_messages + figures.parts_not_drawn, 0);
  return `mission.mcap: ${painted} pixels changed, ${traces} traces of paint, at ${speed.toFixed(2)} times the speed`;
}

await runAll([scan, mission], scratch);
