// `scan --live` as the protocol's own client sees it: connects, subscribes to all channels, decodes the map by the schema that is
// advertised, and compares it with a wall that is known in closed form and with the run's report.
//
//   node test/live.mjs PATH_OF_SCAN
import assert from "node:assert";
import { spawn } from "node:child_process";
import { mkdir, mkdtemp, readFile, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";
import foxglove from "@foxglove/ws-protocol";
import { PNG } from "pngjs";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";
import WebSocket from "ws";

const [program] = process.argv.slice(2);
const [WIDTH, HEIGHT, FOCAL] = [160, 120, 130];
const FRAMES = 12;
/// Points of the wall: z = DISTANCE + SLOPE x, metres.
const [DISTANCE, SLOPE] = [1.5, 0.3];

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
async function record(folder) {
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

const folder = await mkdtemp(join(tmpdir(), "paintcopter-live-"));
await record(folder);
const out = join(folder, "out");
const options = ["--sequence", folder, "--out", out, "--voxel", "0.02", "--threads", "1", "--live", "127.0.0.1:0"];
const run = spawn(program, options, { stdio: ["ignore", "ignore", "pipe"] });
const ended = new Promise((resolve) => run.once("exit", resolve));
const address = await new Promise((resolve, reject) => {
  const said = [];
  createInterface({ input: run.stderr }).on("line", (line) => {
    said.push(line);
    const found = /live view: .*?(ws:\/\/\S+)/.exec(line);
    if (found) resolve(found[1]);
  });
  ended.then(() => reject(new Error(said.join("\n"))));
});

// The client's own name for the protocol is an older one; what it says is the same.
const client = new foxglove.FoxgloveClient({ ws: new WebSocket(address, ["foxglove.sdk.v1"]) });
const channels = new Map();
const patches = new Map();
client.on("error", (error) => assert.fail(error));
client.on("advertise", (advertised) => {
  for (const channel of advertised) {
    const { topic, encoding, schema, schemaName } = channel;
    let decode = (data) => JSON.parse(Buffer.from(data).toString());
    if (encoding === "protobuf") {
      const set = descriptor.FileDescriptorSet.decode(Buffer.from(schema, "base64"));
      const type = protobuf.Root.fromDescriptor(set).lookupType(schemaName);
      decode = (data) => type.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    }
    channels.set(client.subscribe(channel.id), { topic, decode, count: 0 });
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const channel = channels.get(subscriptionId);
  const message = channel.decode(data);
  channel.count++;
  if (channel.topic === "/map") for (const entity of message.entities) patches.set(entity.id, entity.triangles);
});
await new Promise((resolve) => client.on("close", resolve));
assert.equal(await ended, 0);

const counts = Object.fromEntries([...channels.values()].map(({ topic, count }) => [topic, count]));
for (const topic of ["/map", "/tf", "/trajectory", "/camera/pose"]) assert(counts[topic] > 0, JSON.stringify(counts));
const lists = [...patches.values()].flat();
const triangles = lists.reduce((sum, { indices }) => sum + indices.length / 3, 0);
assert.equal(triangles, JSON.parse(await readFile(join(out, "report.json"))).triangles);
const errors = lists.flatMap(({ points }) => points.map(({ x, z }) => Math.abs(z - DISTANCE - SLOPE * x)));
const worst = Math.max(...errors);
assert(errors.length > 500 && worst < 0.005, `${errors.length} points, the worst ${1000 * worst} mm off the wall`);
console.log(`scan --live: ${JSON.stringify(counts)}, ${triangles} triangles as in the report, at most ${(1000 * worst).toFixed(1)} mm off the wall`);
await rm(folder, { recursive: true, force: true });
process.exit(0);
