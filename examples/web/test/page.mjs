// What the tests in a browser share: Chromium that draws in software, a running `vr`, pictures of the screen.
import { spawn } from "node:child_process";
import { rm } from "node:fs/promises";
import { join } from "node:path";
import { chromium } from "playwright-core";

const ARGUMENTS = [
  "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
  "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
];

export const launch = () => chromium.launch({ executablePath: "/usr/bin/chromium", headless: true, args: ARGUMENTS });

/** Starts `vr` with a folder for its results; resolves when it has printed its address. */
export function serve(program, out, ...more) {
  const child = spawn(program, ["--listen", "127.0.0.1:0", "--out", out, ...more], { stdio: ["ignore", "pipe", "pipe"] });
  let said = "";
  child.stderr.on("data", (data) => (said += data));
  const ended = new Promise((resolve) => child.on("exit", resolve));
  return new Promise((resolve, reject) => {
    child.stdout.once("data", (data) => resolve({ address: String(data).trim(), out, child, ended }));
    child.on("exit", (code) => reject(new Error(`vr ended with ${code}: ${said}`)));
  });
}

/** A picture of a part of the screen, for `changed`. */
export const shot = async (page, clip) => (await page.screenshot({ clip })).toString("base64");

/** How many pixels of two pictures differ by more than `least` in one of their colours. */
export const changed = (page, before, after, least = 30) =>
  page.evaluate(async ({ pictures, least }) => {
    const read = async (data) => {
      const png = Uint8Array.from(atob(data), (letter) => letter.charCodeAt(0));
      const picture = await createImageBitmap(new Blob([png], { type: "image/png" }));
      const pen = new OffscreenCanvas(picture.width, picture.height).getContext("2d");
      pen.drawImage(picture, 0, 0);
      return pen.getImageData(0, 0, picture.width, picture.height).data;
    };
    const [a, b] = await Promise.all(pictures.map(read));
    let count = 0;
    for (let k = 0; k < a.length; k += 4) count += [0, 1, 2].some((c) => Math.abs(a[k + c] - b[k + c]) > least) ? 1 : 0;
    return count;
  }, { pictures: [before, after], least });

/** Runs tests one after the other in one browser; each returns a line of what it saw. Ends the process with 1 if one failed. */
export async function runAll(tests, scratch) {
  const browser = await launch();
  let failed = false;
  for (const test of tests) {
    try {
      console.log(`ok    ${await test(browser)}`);
    } catch (error) {
      failed = true;
      console.error(`FAIL  ${test.name}: ${error.stack}`);
    }
  }
  await browser.close();
  await rm(scratch, { recursive: true, force: true });
  process.exit(failed ? 1 : 0);
}
