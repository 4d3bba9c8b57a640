// `vr --design-page` in a real browser: a picture is dropped on a wall of 10 m², moved, a part of the wall chosen and another kept clean; what would come out
// is there within two seconds, and the mission is written.
//
//   node test/design.mjs PATH_OF_VR [FOLDER]      the folder gets screenshots and the mission
import assert from "node:assert/strict";
import { copyFile, mkdir, mkdtemp, readFile, readdir, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { PNG } from "pngjs";
import { runAll, serve } from "./page.mjs";

const [program, pictures] = process.argv.slice(2);
const scratch = await mkdtemp(join(tmpdir(), "paintcopter-design-test-"));
if (pictures) await mkdir(pictures, { recursive: true });

/// A wall of 4 x 2.5 m, and beside it one that stands back at a right angle.
const WALL = "v 0 2 0.5\nv 0 -2 0.5\nv 0 -2 3\nv 0 2 3\nv 1.5 -2 0.5\nv 1.5 -2 3\nf 1 2 3\nf 1 3 4\nf 2 5 6\nf 2 6 3\n";

/// A red disc over a blue box; transparent beside them.
function picture(width, height) {
  const png = new PNG({ width, height });
  for (let k = 0; k < width * height; k++) {
    const [x, y] = [(k % width) / width, Math.floor(k / width) / height];
    const disc = (x - 0.3) ** 2 + (0.75 * (y - 0.35)) ** 2 < 0.05;
    const box = x > 0.45 && x < 0.95 && y > 0.4 && y < 0.92;
    png.data.set(box ? [30, 80, 200, 255] : disc ? [220, 40, 30, 255] : [0, 0, 0, 0], 4 * k);
  }
  return PNG.sync.write(png);
}

const pictureFile = picture(400, 300);

/** Drops a file on the scene as a person does. */
const drop = (page, name, bytes) =>
  page.evaluate(async ({ name, data }) => {
    const bytes = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([bytes], name));
    const scene = document.getElementById("scene");
    for (const type of ["dragenter", "dragover", "drop"]) {
      scene.dispatchEvent(new DragEvent(type, { dataTransfer, bubbles: true, cancelable: true }));
    }
  }, { name, data: Buffer.from(bytes).toString("base64") });

/** Waits for an estimate of all changes so far; with `own` for that of the mission's own texels. */
const estimated = (page, own = false) =>
  page.waitForFunction((own) => {
    const { estimate, link } = window.design;
    const found = estimate();
    return found && found.number >= link.latest && link.left.size === 0 && (!own || found.own) && found.paints.length > 0;
  }, own, { timeout: 150000 });

/** Does what is a change, but not at once, and waits for its estimate. */
async function changed(page, act) {
  const before = await page.evaluate(() => window.design.link.latest);
  await act();
  await page.waitForFunction((before) => window.design.link.latest > before, before);
  await estimated(page);
}

const onScreen = (page, point) => page.evaluate((point) => window.design.onScreen(point), point);
/** The middle of the first face of what is painted. */
const onFirstFace = (page) => page.evaluate(() => {
  const { positions, corners } = window.design.surface().data;
  return [0, 1, 2].map((c) => (positions[3 * corners[0] + c] + positions[3 * corners[1] + c] + positions[3 * corners[2] + c]) / 3);
});
const state = (page) => page.evaluate(() => {
  const { rgba, ...estimate } = window.design.estimate();
  return { estimate, placement: window.design.placement(), surface: window.design.surface().data.area_m2 };
});
const litres = ({ estimate }) => estimate.paints.reduce((sum, paint) => sum + paint.litres, 0);

/** Lines on the bare wall: what is expected is as long and as wide as what was drawn, and the last one can be taken back. */
async function lines(page) {
  const dark = () => page.evaluate(() => {
    const { rgba, texel_m } = window.design.estimate();
    return Array.from({ length: rgba.length / 4 }, (_, k) => k).filter((k) => rgba[4 * k + 3] === 255 && rgba[4 * k + 1] < 90).length * texel_m ** 2;
  });
  const middle = await onFirstFace(page);
  const draw = async (z, length) => {
    const [from, to] = [await onScreen(page, [middle[0], length / 2, z]), await onScreen(page, [middle[0], -length / 2, z])];
    await page.mouse.move(...from);
    await page.mouse.down();
    for (let k = 1; k <= 10; k++) await page.mouse.move(from[0] + ((to[0] - from[0]) * k) / 10, from[1] + ((to[1] - from[1]) * k) / 10);
    await changed(page, () => page.mouse.up());
  };
  await page.click('[data-tool="line"]');
  await page.fill("#line-width", "0.3");
  await draw(2, 1.5);
  const one = await dark();
  assert.ok(Math.abs(one / (1.5 * 0.3 + (Math.PI * 0.3 ** 2) / 4) - 1) < 0.2, `${one} m² of a line`);
  assert.equal(await page.isDisabled("#undo-line"), true, "nothing would be left");
  await draw(2.6, 1);
  assert.ok((await dark()) > 1.4 * one, `${await dark()} m² of two lines`);
  if (pictures) await page.screenshot({ path: join(pictures, "design-lines.png") });
  await changed(page, () => page.click("#undo-line"));
  assert.ok(Math.abs((await dark()) / one - 1) < 0.02, "the last line is taken back");
}

async function design(browser) {
  await writeFile(join(scratch, "wall.obj"), WALL);
  const options = ["--design-page", "--mesh", join(scratch, "wall.obj"), "--up", "z", "--scale", "1"];
  const server = await serve(program, join(scratch, "out"), ...options);
  const page = await browser.newPage({ viewport: { width: 1100, height: 800 } });
  page.on("pageerror", (error) => {
    throw error;
  });
  await page.goto(server.address);
  await page.waitForFunction(() => window.design?.estimate() && document.getElementById("dot").classList.contains("on"));
  assert.equal(await page.isDisabled("#write"), true, "without a picture there is no mission");

  // The wall alone: a click on it, and it is seen from its front.
  await page.click('[data-tool="region"]');
  await page.mouse.click(...(await onScreen(page, await onFirstFace(page))));
  await page.waitForFunction(() => Math.abs(window.design.surface().data.area_m2 - 10) < 1e-6, null, { timeout: 20000 });

  await lines(page);
  await drop(page, "not a picture.png", Buffer.from("hello"));
  await page.waitForFunction(() => /is no picture/.test(document.getElementById("notice").textContent));
  await changed(page, () => drop(page, "disc & box.png", pictureFile));
  const whole = await state(page);
  // As large as fits: 2.5 m high, 3.33 m wide.
  assert.ok(Math.abs(whole.placement.size - 10 / 3) < 0.08, `it fits: ${whole.placement.size} m`);

  await page.click('[data-tool="place"]');
  await page.fill("#size", "2");
  await page.press("#size", "Enter");
  await estimated(page);
  const dropped = await state(page);
  const share = litres(dropped) / litres(whole);
  assert.ok(share > 0.2 && share < 0.55, `paint goes with the area: ${share}, by area ${(0.6 ** 2).toFixed(2)}`);

  const middle = await onFirstFace(page);
  // Dragged by half a metre to the right, which is -y before a wall that faces the robot.
  const from = await onScreen(page, [middle[0], -0.1, middle[2]]);
  const to = await onScreen(page, [middle[0], -0.6, middle[2]]);
  await page.mouse.move(...from);
  await page.mouse.down();
  for (let k = 1; k <= 10; k++) await page.mouse.move(from[0] + ((to[0] - from[0]) * k) / 10, from[1] + ((to[1] - from[1]) * k) / 10);
  await page.mouse.up();
  await estimated(page);
  const moved = await state(page);
  assert.ok(Math.abs(moved.placement.offset[0] - 0.5) < 0.03, `moved by ${moved.placement.offset[0]} m`);
  assert.ok(Math.abs(moved.placement.offset[1]) < 0.03);
  await page.mouse.move(...to);
  await page.keyboard.down("Shift");
  await page.mouse.wheel(0, -200);
  await page.keyboard.up("Shift");
  await estimated(page);
  assert.ok((await state(page)).placement.rotate > 0.05, "the wheel turns it");

  // A disc of 35 cm stays clean.
  await page.click('[data-tool="clean"]');
  await page.selectOption("#part", "disc");
  await page.fill("#radius", "0.35");
  await page.mouse.click(...to);
  await estimated(page);
  const clean = await page.evaluate(() => {
    const { rgba, texel_m } = window.design.estimate();
    return rgba.filter((value, k) => k % 4 === 3 && value === 170).length * texel_m ** 2;
  });
  assert.ok(Math.abs(clean / (Math.PI * 0.35 ** 2) - 1) < 0.15, `${clean} m² stay clean`);
  if (pictures) await page.screenshot({ path: join(pictures, "design-estimate.png") });
  await page.selectOption("#palette", "cmyk");
  await estimated(page);

  const times = await page.evaluate(() => window.design.link.times);
  await estimated(page, true);
  if (pictures) await page.screenshot({ path: join(pictures, "design.png") });
  await page.click("#write");
  await page.waitForFunction(() => /is written/.test(document.getElementById("written").textContent));
  await page.click("#write");
  await page.waitForFunction(() => /mission-2.toml/.test(document.getElementById("written").textContent));
  const mission = await readFile(join(server.out, "mission.toml"), "utf8");
  for (const line of ['design = "disc___box.png"', 'palette = "cmyk"', 'region = "pick:', 'keep_clean = ["plane:']) {
    assert.ok(mission.includes(line), `${line}: ${mission}`);
  }
  assert.equal(await readFile(join(server.out, "mission-2.toml"), "utf8"), mission);
  assert.deepEqual(await readFile(join(server.out, "disc___box.png")), pictureFile);
  assert.equal((await readdir(server.out)).filter((name) => name.endsWith(".png")).length, 1, "the picture is written once");
  if (pictures) await copyFile(join(server.out, "mission.toml"), join(pictures, "mission.toml"));
  await page.click("#end");
  assert.equal(await server.ended, 0, "vr ends well");
  const report = JSON.parse(await readFile(join(server.out, "report.json"), "utf8"));
  assert.equal(report.missions, 2);
  await page.close();
  const seconds = times.map((time) => time / 1000).sort((a, b) => a - b);
  const [median, longest] = [seconds[Math.floor(seconds.length / 2)], seconds.at(-1)];
  return `design: from a change to what it comes to on a wall of 10 m² ${median.toFixed(2)} s in the median, at most ${longest.toFixed(2)} s, of ${seconds.length}; the mission is written`;
}

await runAll([design], scratch);
