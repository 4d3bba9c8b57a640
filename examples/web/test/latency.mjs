// How long a state takes to the plan's input and back, without a picture: a hand at 90 Hz that paints and rests.
//
//   node --experimental-websocket test/latency.mjs PATH_OF_VR [SECONDS]
import { spawn } from "node:child_process";
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";

const [program, seconds = "20"] = process.argv.slice(2);
const out = await mkdtemp(join(tmpdir(), "paintcopter-latency-"));
const server = spawn(program, ["--listen", "127.0.0.1:0", "--out", out], { stdio: ["ignore", "pipe", "ignore"] });
const address = await new Promise((resolve) => server.stdout.once("data", (data) => resolve(String(data).trim())));
const socket = new WebSocket(`${address.replace("http", "ws")}session`);
const sent = [];
const answers = [];
let sequence = 0;
socket.onmessage = ({ data }) => {
  if (typeof data !== "string") return;
  if (JSON.parse(data).type === "ack") answers.push(performance.now() - sent.shift());
};
await new Promise((resolve) => (socket.onopen = resolve));
await new Promise((resolve) => setTimeout(resolve, 500));
const begun = performance.now();
await new Promise((done) => {
  const timer = setInterval(() => {
    const time = (performance.now() - begun) / 1000;
    if (time > Number(seconds)) {
      clearInterval(timer);
      return done();
    }
    while (sequence / 90 <= time) {
      const at = sequence / 90;
      const mode = at % 8 < 5 ? "painting" : "idle";
      const nozzle = { translation: [-0.6, 0.5 - 0.08 * (at % 12), 2.6], rotation: [0, 0, 0, 1] };
      const state = { version: 1, sequence, time: at, mode, nozzle, cradle: { position: [-1.2, 0, 2.6], heading: 0 }, colour: 0, flow: 2e-7 };
      sent.push(performance.now());
      socket.send(JSON.stringify({ events: [{ state }] }));
      sequence++;
    }
  }, 1);
});
await new Promise((resolve) => setTimeout(resolve, 500));
answers.sort((a, b) => a - b);
const rank = (share) => answers[Math.min(answers.length - 1, Math.floor(share * answers.length))].toFixed(2);
console.log(`${answers.length} states answered, median ${rank(0.5)} ms, 99 % ${rank(0.99)} ms, most ${rank(1)} ms`);
socket.close();
server.kill();
await rm(out, { recursive: true, force: true });
process.exit(0);
