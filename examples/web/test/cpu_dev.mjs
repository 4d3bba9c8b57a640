import { mkdtemp, rm, readFile, readdir } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { launch, serve } from "./page.mjs";
const program = process.argv[2];
const variants = JSON.parse(process.argv[3] ?? '[{}]');
async function cpu(type) {
  const sum = {};
  for (const pid of await readdir("/proc")) if (/^\d+$/.test(pid)) try {
    const cmd = await readFile(`/proc/${pid}/cmdline`, "utf8");
    if (!/chromium/.test(cmd)) continue;
    const kind = /--type=([a-z-]+)/.exec(cmd)?.[1] ?? "browser";
    const stat = (await readFile(`/proc/${pid}/stat`, "utf8")).split(") ")[1].split(" ");
    sum[kind] = (sum[kind] ?? 0) + 10 * (Number(stat[11]) + Number(stat[12]));
  } catch {}
  return sum;
}
const scratch = await mkdtemp(join(tmpdir(), "pc-cpu-"));
const server = await serve(program, join(scratch, "out"), "--offline");
for (const v of variants) {
  const browser = await launch();
  const page = await browser.newPage({ viewport: { width: 640, height: 480 } });
  await page.route("**/app.js*", (r) => r.fulfill({ path: v.app ?? "dist/app.js", contentType: "text/javascript" }));
  await page.goto(server.address);
  await page.waitForFunction(() => window.paintcopter?.first.drawn > 0);
  await page.waitForTimeout(1000);
  if (v.code) await page.evaluate(v.code);
  if (v.ratio) await page.evaluate((r) => { const { renderer } = window.paintcopter; renderer.setPixelRatio(r); renderer.setPixelRatio = () => {}; }, v.ratio);
  await page.waitForTimeout(500);
  for (const paint of [false, true]) {
    if (paint) { await page.mouse.move(200, 200); await page.mouse.down(); }
    const a = await cpu(), fa = await page.evaluate(() => window.paintcopter.renderer.info.render.frame), ta = Date.now();
    const end = Date.now() + 4000;
    for (let k = 0; Date.now() < end; k++) { if (paint) await page.mouse.move(320 + 120 * Math.cos(k / 12), 220 + 60 * Math.sin(k / 12)); await page.waitForTimeout(8); }
    const b = await cpu(), fb = await page.evaluate(() => window.paintcopter.renderer.info.render.frame), tb = Date.now();
    if (paint) await page.mouse.up();
    const n = fb - fa;
    console.log(v.name ?? "", paint ? "paint" : "idle ", "frames/s", (1000 * n / (tb - ta)).toFixed(1), "cpu ms/frame", Object.entries(b).map(([k, x]) => `${k} ${((x - (a[k] ?? 0)) / n).toFixed(1)}`).join(" "), "ratio", await page.evaluate(() => window.paintcopter.renderer.getPixelRatio()));
  }
  await browser.close();
}
server.child.kill();
await rm(scratch, { recursive: true, force: true });
