// A recording of depth pictures of a slanted wall, which is known in closed form.
import { mkdir, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { createInterface } from "node:readline";
import { PNG } from "pngjs";

const [WIDTH, HEIGHT, FOCAL] = [160, 120, 130];
const FRAMES = 12;
/// Points of the wall: z = DISTANCE + SLOPE x, metres.
export const [DISTANCE, SLOPE] = [1.5, 0.3];

/// The wall from x = `shift`: a PNG of 16 bits, millimetres along the optical axis.
function depthPng(shift) {
  const depth = new Uint16Array(WIDTH * HEIGHT);
  for (let k = 0; k < depth.length; k++) {
    const slant = ((k % WIDTH) - (WIDTH - 1) / 2) / FOCAL;
    depth[k] = Math.round((1000 * (DISTANCE + SLOPE * shift)) / (1 - SLOPE * slant));
  }
  const grey = { colorType: 0, inputColorType: 0, inputHasAlpha: false, bitDepth: 16 };
  return PNG.sync.write({ width: WIDTH, height: HEIGHT, data: Buffer.from(depth.buffer) }, grey);
}

/// A recording in TUM's layout, there and back again until the viewer has surely come.
export async function record(folder) {
  await mkdir(join(folder, "depth"), { recursive: true });
  const shifts = Array.from({ length: FRAMES }, (_, k) => 0.3 * (k / FRAMES));
  for (const [k, shift] of shifts.entries()) await writeFile(join(folder, `depth/${k}.png`), depthPng(shift));
  const order = Array.from({ length: 60 * FRAMES }, (_, k) => ({ stamp: 10 + 0.1 * k, k: k % FRAMES }));
  const lines = (line) => order.map(line).join("\n") + "\n";
  await writeFile(join(folder, "depth.txt"), lines(({ stamp, k }) => `${stamp.toFixed(1)} depth/${k}.png`));
  await writeFile(join(folder, "groundtruth.txt"), lines(({ stamp, k }) => `${stamp.toFixed(1)} ${shifts[k]} 0 0 0 0 0 1`));
  const intrinsics = [WIDTH, HEIGHT, FOCAL, FOCAL, (WIDTH - 1) / 2, (HEIGHT - 1) / 2, 1000];
  await writeFile(join(folder, "intrinsics.txt"), intrinsics.join(" ") + "\n");
}

/// Resolves with the address that `scan --live` prints; `child` has its standard error as a pipe.
export function liveAddress(child) {
  const ended = new Promise((resolve) => child.once("exit", resolve));
  return new Promise((resolve, reject) => {
    const said = [];
    createInterface({ input: child.stderr }).on("line", (line) => {
      said.push(line);
      const found = /live view: .*?(ws:\/\/\S+)/.exec(line);
      if (found) resolve(found[1]);
    });
    ended.then(() => reject(new Error(said.join("\n"))));
  });
}
