// `scan --live` as the protocol's own client sees it: connects, subscribes to all channels, decodes the map by the schema that is
// advertised, and compares it with a wall that is known in closed form and with the run's report.
//
//   node test/live.mjs PATH_OF_SCAN
import assert from "node:assert";
import { spawn } from "node:child_process";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import foxglove from "@foxglove/ws-protocol";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";
import WebSocket from "ws";
import { DISTANCE, SLOPE, liveAddress, record } from "./wall_recording.mjs";

const [program] = process.argv.slice(2);
const folder = await mkdtemp(join(tmpdir(), "paintcopter-live-"));
await record(folder);
const out = join(folder, "out");
const options = ["--sequence", folder, "--out", out, "--voxel", "0.02", "--threads", "1", "--live", "127.0.0.1:0"];
const run = spawn(program, options, { stdio: ["ignore", "ignore", "pipe"] });
const ended = new Promise((resolve) => run.once("exit", resolve));
const address = await liveAddress(run);

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
