// The page in a real browser: mouse, an emulated headset, a lost connection, a stranger.
//
//   node test/browser.mjs PATH_OF_VR [FOLDER]      the folder gets screenshots and the headset's recorded session
import { copyFile, mkdtemp, mkdir, readFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { spawn } from "node:child_process";
import assert from "node:assert/strict";
import { runAll, serve as start } from "./page.mjs";

const [program, pictures] = process.argv.slice(2);
const scratch = await mkdtemp(join(tmpdir(), "paintcopter-browser-"));
if (pictures) await mkdir(pictures, { recursive: true });
const headsetScript = await readFile(new URL("../node_modules/iwer/build/iwer.min.js", import.meta.url), "utf8");
const serve = (name, ...more) => start(program, join(scratch, name), ...more);

const report = async (server) => JSON.parse(await readFile(join(server.out, "report.json"), "utf8"));

async function open(browser, server, headset = false) {
  const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
  page.on("pageerror", (error) => {
    throw error;
  });
  if (headset) await page.addInitScript({ content: `${headsetScript};${installHeadset}` });
  await page.goto(server.address);
  await page.waitForFunction(() => window.paintcopter?.wall() && document.getElementById("dot").classList.contains("on"));
  // Strokes that a short test is to see.
  await page.evaluate(() => { document.getElementById("flow").value = "0.8"; });
  // The first pictures have come when the server has had a few states.
  await page.waitForTimeout(700);
  return page;
}

/** Mean colour of a square of the screen. */
async function colour(page, x, y, half = 4) {
  const clip = { x: x - half, y: y - half, width: 2 * half, height: 2 * half };
  const data = (await page.screenshot({ clip })).toString("base64");
  return page.evaluate(async (data) => {
    const png = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
    const picture = await createImageBitmap(new Blob([png], { type: "image/png" }));
    const canvas = new OffscreenCanvas(picture.width, picture.height);
    const pen = canvas.getContext("2d");
    pen.drawImage(picture, 0, 0);
    const bytes = pen.getImageData(0, 0, picture.width, picture.height).data;
    const sum = [0, 0, 0];
    for (let k = 0; k < bytes.length; k += 4) for (let c = 0; c < 3; c++) sum[c] += bytes[k + c];
    return sum.map((total) => (4 * total) / bytes.length);
  }, data);
}

const difference = (a, b) => Math.max(...a.map((value, k) => Math.abs(value - b[k])));

/** A stroke with the mouse; `halfway` is called in its middle. */
async function stroke(page, from, to, halfway = async () => {}) {
  await page.mouse.move(...from);
  await page.mouse.down();
  for (let k = 1; k <= 20; k++) {
    await page.mouse.move(from[0] + ((to[0] - from[0]) * k) / 20, from[1] + ((to[1] - from[1]) * k) / 20);
    await page.waitForTimeout(25);
    if (k === 10) await halfway();
  }
  await page.mouse.up();
}

/** Whether a movement that reaches the page 40 ms after it was made is a state later than those before it. */
const comesLate = (page) =>
  page.evaluate(async () => {
    const { connection } = window.paintcopter;
    const canvas = document.getElementById("scene");
    const frame = () => new Promise((done) => requestAnimationFrame(done));
    const times = [];
    const { state } = connection;
    connection.state = (next) => {
      times.push(next.time);
      return state.call(connection, next);
    };
    const place = canvas.getBoundingClientRect();
    const send = (name, event) => canvas.dispatchEvent(event ?? new PointerEvent(name, { clientX: place.x + 300, clientY: place.y + 150, pointerId: 1 }));
    canvas.setPointerCapture = () => {};
    send("pointerdown");
    const down = performance.now();
    while (performance.now() - down < 300) await frame();
    const rested = times.length;
    // The page has just said where the pointer rests.
    const init = { clientX: place.x + 310, clientY: place.y + 150, pointerId: 1 };
    const made = new PointerEvent("pointermove", init);
    Object.defineProperty(made, "timeStamp", { value: performance.now() - 40 });
    const late = new PointerEvent("pointermove", { ...init, coalescedEvents: [made] });
    send("pointermove", late);
    send("pointerup");
    delete connection.state;
    delete canvas.setPointerCapture;
    return { rested, later: times.every((time, k) => k === 0 || time >= times[k - 1]) };
  });

async function settled(page) {
  await page.waitForFunction(() => window.paintcopter.connection.waiting < 5, null, { timeout: 20000 });
  await page.waitForTimeout(400);
}

async function end(page, server) {
  // In the headset another canvas lies over the buttons.
  await page.evaluate(() => document.getElementById("end").click());
  assert.equal(await server.ended, 0, "vr ends well");
  // The page says where the results are, and goes on saying it.
  await page.waitForTimeout(4500);
  const words = await page.evaluate(() => [document.getElementById("notice").textContent, getComputedStyle(document.getElementById("notice")).opacity]);
  assert.ok(words[0].startsWith(`results in ${server.out}`) && words[1] === "1", `last words: ${words}`);
}

async function mouse(browser) {
  const server = await serve("mouse", "--offline");
  const page = await open(browser, server);
  const place = [300, 200];
  const aside = [520, 330];
  await page.mouse.move(...aside);
  await page.waitForTimeout(300);
  const bare = await colour(page, ...place);
  await stroke(page, [220, 200], [380, 200]);
  await page.mouse.move(...aside);
  await settled(page);
  const painted = await colour(page, ...place);
  assert.ok(difference(bare, painted) > 40, `the stroke is seen: ${bare} became ${painted}`);
  assert.ok(difference(bare, await colour(page, 300, 120)) < 60, "beside it the wall is bare");
  if (pictures) await page.screenshot({ path: join(pictures, "mouse.png") });
  // The page has shown its own guess of the paint, and nothing of it is left when the server's has come.
  const guess = await page.evaluate(() => {
    const { shown, truth } = window.paintcopter.atlas().pictures[0];
    const different = shown.reduce((count, byte, k) => count + (byte === truth[k] ? 0 : 1), 0);
    return { different, shown: window.paintcopter.delays.stages["hand to guess"].length };
  });
  assert.ok(guess.shown > 0 && guess.different === 0, `a guess is shown and replaced: ${JSON.stringify(guess)}`);
  const [screen, guessed, answer] = await page.evaluate(() => {
    const rank = (times, share) => times.toSorted((a, b) => a - b)[Math.min(times.length - 1, Math.floor(share * times.length))] ?? NaN;
    const { delays, connection } = window.paintcopter;
    const { stages } = delays;
    return [rank(stages["hand to screen"], 0.95), rank(stages["hand to guess"], 0.95), rank(connection.roundTrips, 0.99)];
  });
  await page.click("#undo");
  await page.mouse.move(...aside);
  await settled(page);
  const undone = await colour(page, ...place);
  assert.ok(difference(bare, undone) < 6, `the stroke is taken back: ${bare} became ${undone}`);
  // Another colour, half of it erased.
  await page.click("#palette button:nth-child(2)");
  await stroke(page, [220, 200], [380, 200]);
  await page.click("#erase");
  await stroke(page, [340, 200], [390, 200]);
  await page.click("#erase");
  await page.mouse.move(...aside);
  await settled(page);
  const left = await colour(page, 260, 200);
  assert.ok(left[0] > left[1] + 40, `red paint: ${left}`);
  assert.ok(difference(await colour(page, 370, 200), await colour(page, 370, 150)) < 40, "the eraser has erased");
  const late = await comesLate(page);
  assert.ok(late.rested > 2 && late.later, `a hand at rest does not overtake its own movements: ${JSON.stringify(late)}`);
  await page.click("#fly");
  await settled(page);
  await end(page, server);
  const figures = await report(server);
  assert.ok(figures.paint_tasks >= 1 && figures.paint_flown_ml > 0.9 * figures.paint_seen_ml, JSON.stringify(figures));
  assert.equal(figures.refused_events, 0);
  await page.close();
  return `mouse: ${figures.states} states, SSIM of flown and seen ${figures.ssim_flown_seen.toFixed(3)}; hand to screen ${screen.toFixed(0)} ms, to the guess ${guessed.toFixed(0)} ms (p95), state to answer ${answer.toFixed(1)} ms (p99)`;
}

async function lost(browser) {
  const server = await serve("lost", "--offline");
  const page = await open(browser, server);
  const aside = [520, 330];
  await page.mouse.move(...aside);
  const bare = await colour(page, 300, 200);
  await stroke(page, [220, 200], [380, 200], async () => {
    await page.evaluate(() => window.paintcopter.connection.drop());
  });
  await page.waitForFunction(() => document.getElementById("dot").classList.contains("on"), null, { timeout: 20000 });
  await page.mouse.move(...aside);
  await settled(page);
  for (const x of [230, 290, 310, 370]) {
    const painted = await colour(page, x, 200);
    assert.ok(difference(bare, painted) > 30, `the stroke is whole at ${x}: ${bare}, ${painted}`);
  }
  // A stranger on the same machine: the place is taken.
  const stranger = await browser.newPage({ viewport: { width: 640, height: 480 } });
  await stranger.goto(server.address);
  await stranger.waitForFunction(() => /another person is here/.test(document.getElementById("connection").textContent));
  assert.equal(await stranger.evaluate(() => window.paintcopter.wall()), null, "a second person sees nothing");
  if (pictures) await stranger.screenshot({ path: join(pictures, "stranger.png") });
  await stranger.close();
  await end(page, server);
  const figures = await report(server);
  assert.ok(figures.connections === 2 && figures.missing_ticks === 0, JSON.stringify(figures));
  assert.equal(figures.events, figures.states + 1, "every event once: the states and the end");
  await page.close();
  return `lost connection: ${figures.states} states, ${figures.repeated_events} came twice and counted once, none is missing`;
}

/** Buttons of the recording, by mouse and by keyboard. */
async function buttons(browser) {
  const server = await serve("buttons", "--offline");
  const page = await open(browser, server);
  const aside = [520, 330];
  await page.mouse.move(...aside);
  const bare = await colour(page, 300, 200);
  const pressed = (id) => page.evaluate((id) => document.getElementById(id).getAttribute("aria-pressed"), id);
  await page.click("#pause");
  await page.waitForTimeout(300);
  assert.deepEqual([await pressed("pause"), await pressed("record")], ["true", "false"], "it is paused");
  await stroke(page, [220, 200], [380, 200]);
  await page.mouse.move(...aside);
  await settled(page);
  assert.ok(difference(bare, await colour(page, 300, 200)) < 6, "a hand during a pause paints nothing");
  await page.keyboard.press("r");
  await page.waitForTimeout(300);
  assert.deepEqual([await pressed("pause"), await pressed("record")], ["false", "true"], "it records again");
  await stroke(page, [220, 200], [380, 200]);
  await page.mouse.move(...aside);
  await settled(page);
  assert.ok(difference(bare, await colour(page, 300, 200)) > 40, "afterwards it paints");
  await page.keyboard.press("Control+s");
  await page.waitForFunction(() => /saved: /.test(document.getElementById("notice").textContent), null, { timeout: 60000 });
  const path = (await page.textContent("#notice")).slice("saved: ".length).split(";")[0];
  assert.equal(path, join(server.out, "session.mcap"));
  const saved = await readFile(path);
  const magic = Buffer.from([0x89, ...Buffer.from("MCAP0\r\n")]);
  assert.ok(saved.subarray(-8).equals(magic), "what is saved is a whole file");
  const first = await report(server);
  assert.ok(first.paint_seen_ml > 0 && first.events > 50);
  await page.keyboard.press("p");
  await page.waitForTimeout(200);
  assert.equal(await pressed("pause"), "true");
  await page.keyboard.press("Control+Enter");
  assert.equal(await server.ended, 0, "vr ends well");
  const last = await report(server);
  assert.ok(last.events > first.events && last.paint_flown_ml > 0.9 * last.paint_seen_ml, JSON.stringify(last));
  assert.ok((await readFile(path)).length > saved.length, "the recording went on");
  await page.close();
  // The recorded session is whole, the pause in it: it paints the same again.
  const replay = spawn(program, ["--replay", path, "--out", join(scratch, "again")], { stdio: "ignore" });
  assert.equal(await new Promise((resolve) => replay.on("exit", resolve)), 0, "the replay makes the same plans");
  assert.ok(Math.abs(JSON.parse(await readFile(join(scratch, "again", "report.json"))).paint_seen_ml - last.paint_seen_ml) < 1e-9);
  return `buttons: saved after ${first.events} of ${last.events} events, paused twice, replayed the same`;
}

// A headset with controllers like the wands of the paper: trigger, squeeze, touchpad.
const installHeadset = `(() => {
  const pad = { id: "touchpad", type: "binary" };
  const gamepad = {
    mapping: "xr-standard",
    buttons: [{ id: "trigger", type: "analog", eventTrigger: "select" }, { id: "squeeze", type: "binary", eventTrigger: "squeeze" }, pad],
    axes: [{ id: "touchpad", type: "x-axis" }, { id: "touchpad", type: "y-axis" }],
  };
  const hand = { gamepad, gripOffsetMatrix: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1], numHapticActuators: 1 };
  const controllerConfig = { profileId: "htc-vive", fallbackProfileIds: ["generic-trigger-squeeze-touchpad"], layout: { left: hand, right: hand } };
  const device = new IWER.XRDevice({ ...IWER.metaQuest3, name: "wands", controllerConfig });
  device.installRuntime({ forceInstall: true });
  window.device = device;
})()`;

async function headset(browser) {
  const server = await serve("headset");
  const page = await open(browser, server, true);
  await page.waitForFunction(() => !document.getElementById("enter").hidden);
  await page.click("#enter");
  await page.waitForFunction(() => window.paintcopter.headset.presenting);
  // The right hand before the wall, straight on; the person steps nearer with the left touchpad first.
  await page.evaluate(() => {
    const { left, right } = window.device.controllers;
    right.position.set(0.1, 1.6, -0.5);
    right.quaternion.set(0, 0, 0, 1);
    left.position.set(-0.3, 1.3, -0.3);
    left.updateAxes("touchpad", 0, -1);
  });
  await page.waitForTimeout(900);
  await page.evaluate(() => window.device.controllers.left.updateAxes("touchpad", 0, 0));
  const before = await page.evaluate(() => window.paintcopter.cradle.group.position.toArray());
  const shot = async () => (await page.screenshot({ clip: { x: 0, y: 0, width: 640, height: 400 } })).toString("base64");
  const changed = (a, b) =>
    page.evaluate(async ([a, b]) => {
      const pixels = await Promise.all(
        [a, b].map(async (data) => {
          const png = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
          const picture = await createImageBitmap(new Blob([png], { type: "image/png" }));
          const pen = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
          pen.drawImage(picture, 0, 0);
          return pen.getImageData(0, 0, picture.width, picture.height).data;
        }),
      );
      let count = 0;
      for (let k = 0; k < pixels[0].length; k += 4) count += pixels[0][k] - pixels[1][k] > 50 ? 1 : 0;
      return count;
    }, [a, b]);
  const bare = await shot();
  await page.evaluate(() => window.device.controllers.right.updateButtonValue("touchpad", 1));
  for (let k = 0; k <= 30; k++) {
    await page.evaluate((x) => window.device.controllers.right.position.set(x, 1.6, -0.5), 0.1 - 0.01 * k);
    await page.waitForTimeout(30);
  }
  await page.evaluate(() => window.device.controllers.right.updateButtonValue("touchpad", 0));
  await settled(page);
  const painted = await shot();
  const pixels = await changed(bare, painted);
  if (pictures) await page.screenshot({ path: join(pictures, "headset.png") });
  assert.ok(pixels > 300, `the stroke is seen in the headset: ${pixels} pixels became darker`);
  // The trigger views.
  await page.evaluate(() => window.device.controllers.right.updateButtonValue("trigger", 1));
  await page.waitForTimeout(500);
  assert.equal(await page.evaluate(() => window.paintcopter.headset.mode), "viewing");
  await page.evaluate(() => window.device.controllers.right.updateButtonValue("trigger", 0));
  await page.waitForTimeout(300);
  await page.evaluate(() => window.device.activeSession?.end());
  await page.waitForTimeout(300);
  // Which button paints is kept by the browser.
  await page.evaluate(() => document.getElementById("hands").click());
  await page.reload();
  await page.waitForFunction(() => window.paintcopter?.wall() && document.getElementById("dot").classList.contains("on"));
  assert.equal(await page.textContent("#hands"), "paint: trigger");
  await end(page, server);
  if (pictures) await copyFile(join(server.out, "session.mcap"), join(pictures, "headset.mcap"));
  const figures = await report(server);
  assert.ok(figures.paint_tasks >= 1 && figures.paint_flown_ml > 0.5 * figures.paint_seen_ml, JSON.stringify(figures));
  assert.ok(before.every(Number.isFinite));
  await page.close();
  return `headset: ${pixels} pixels painted, ${figures.paint_tasks} segments flown live`;
}

await runAll([mouse, lost, buttons, headset], scratch);
