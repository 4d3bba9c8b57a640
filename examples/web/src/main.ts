// The page of `vr`: a wall to paint, a gun, a robot that follows.
import * as THREE from "three";
import { Atlas } from "./atlas";
import { Banner } from "./banner";
import { Connection } from "./connection";
import { Cradle } from "./cradle";
import { Delays, rasterised } from "./delays";
import { Echo } from "./echo";
import { Gun } from "./gun";
import { Headset } from "./headset";
import { sky, sun } from "./light";
import { Pointer } from "./pointer";
import { PROTOCOL, STATE_VERSION, readEntity, readPatch, readPicture, readSurface } from "./protocol";
import type { Mode, Notice, ServerMessage, State, Triple } from "./protocol";
import { Quality, drawsInSoftware } from "./quality";
import { Robot } from "./robot";
import { Tools } from "./tools";
import { Wall } from "./wall";
import type { Hit } from "./wall";
import { Watch } from "./watch";

// Time without a movement after which a pointer rests, milliseconds; as long as a movement may be on its way to the page.
const STILL = 60;
// Radius of the eraser, metres.
const ERASER = 0.06;

const canvas = document.getElementById("scene") as HTMLCanvasElement;
const software = drawsInSoftware();
const renderer = new THREE.WebGLRenderer({ canvas, antialias: !software });
// Where the processor draws, a picture that waits behind another is late: one at a time.
let drawing = false;
// Whether anything differs from what is drawn, and what the hand was drawn like.
let stale = true;
let held = "";
const quality = new Quality(renderer);
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xdfe7ec);
scene.fog = new THREE.Fog(0xdfe7ec, 12, 40);
scene.add(sky, sun, sun.target);
const ground = new THREE.Mesh(new THREE.CircleGeometry(30, 64), new THREE.MeshLambertMaterial({ color: 0xb9c2c6 }));
scene.add(ground);
const grid = new THREE.GridHelper(30, 30, 0x9aa7ae, 0xa9b4ba);
grid.rotateX(Math.PI / 2).translateY(0.002);
scene.add(grid);

const camera = new THREE.PerspectiveCamera(62, 1, 0.03, 60);
const cradle = new Cradle();
cradle.group.add(camera);
scene.add(cradle.group);
const banner = new Banner(document.getElementById("notice") as HTMLElement);
camera.add(banner.sign);
const robot = new Robot();
const gun = new Gun();
scene.add(robot.group, gun.group);
// When the pointer has last painted, milliseconds.
let moved = 0;
// A slow picture must not make strokes coarse: the pointer's own events are states as well.
const pointer = new Pointer(canvas, cradle, (time) => {
  if (!wall || headset.presenting) return;
  moved = performance.now();
  publish(wall, time);
});
const headset = new Headset(renderer, cradle);
const caster = new THREE.Raycaster();

let atlas: Atlas | null = null;
let echo: Echo | null = null;
let wall: Wall | null = null;
let watch: Watch | null = null;
let placed = false;
const delays = new Delays();
// When the surface has come, and when it was first seen, milliseconds after the page was asked for.
const first = { surface: 0, drawn: 0 };
// The session's clock goes on where it was when the page came.
let begun = 0;

const tools = new Tools((name, on) => {
  switch (name) {
    case "live":
      return connection.command({ do: "live", on });
    case "flown":
      stale = true;
      if (wall) wall.flown = on;
      return;
    case "record":
    case "pause":
      return pause((name === "pause") === on);
    case "hands":
      headset.swap();
      return tools.hands(headset.swapped);
    case "enter":
      return void headset.enter();
    case "undo":
    case "fly":
    case "save":
    case "end":
      return connection.command({ do: name });
  }
});

function pause(on: boolean): void {
  tools.paused(on);
  connection.command({ do: "pause", on });
}

const sent = (before: number) => delays.sent(before);
const connection = new Connection({
  message,
  binary,
  sent,
  connected: (open) => tools.connected(open, connection.waiting),
  occupied: () => tools.status("another person is here: this page waits"),
});

function message(message: ServerMessage): void {
  stale ||= message.type !== "ack" && message.type !== "robot";
  switch (message.type) {
    case "welcome":
      if (message.protocol !== PROTOCOL) return location.reload();
      document.title = `PaintCopter: ${message.name}`;
      tools.welcome(message);
      atlas ??= new Atlas(...message.atlas);
      echo ??= new Echo(atlas.pictures[0]);
      if (!placed) {
        begun = message.clock + 0.01 - performance.now() / 1000;
        stand(message.cradle, message.heading);
      }
      return;
    case "watching":
      if (message.protocol !== PROTOCOL) return location.reload();
      document.title = `PaintCopter: ${message.name}`;
      tools.watching(true);
      tools.paused(message.paused);
      // A page that comes back is told of everything again.
      if (watch) scene.remove(watch.group);
      watch = new Watch();
      scene.add(watch.group);
      robot.group.visible = gun.visible = false;
      return;
    case "ack":
      echo?.answer(message.next_sequence);
      return delays.answered(message.next_sequence);
    case "place":
      watch?.place(message);
      if (!placed) stand(message.cradle, message.heading);
      return;
    case "frames":
      return watch?.move(message.frames);
    case "playback":
      tools.paused(message.paused);
      return tools.playback(message.elapsed);
    case "robot":
      if (robot.update(message)) stale = true;
      return tools.robot(message);
    case "notice":
      return notice(message.notice);
  }
}

/** Puts the person there, with the sun behind. */
function stand(at: Triple, heading: number): void {
  cradle.place(at, heading);
  const back = new THREE.Vector3(-Math.cos(heading), -Math.sin(heading), 0);
  sun.position.copy(back).multiplyScalar(4).add(new THREE.Vector3(0, 0, 7)).addScaledVector(new THREE.Vector3(-back.y, back.x, 0), 3);
  placed = true;
}

/** What the mission lacks, from a hundredth of the paint on. */
const leftOut = (share: number): string =>
  share < 0.01 ? "" : `; mission.toml leaves out ${Math.round(100 * share)} % of the paint, which lies too thick: less flow, or faster`;

function notice(notice: Notice): void {
  const say = (text: string) => banner.say(text, headset.presenting);
  if (notice.type === "text") return say(notice.text);
  if (notice.type === "saved") return say(`saved: ${notice.path}${leftOut(notice.left_out)}`);
  if (notice.type === "ended") {
    connection.end();
    tools.status("ended");
    const results = `results in ${notice.folder}${leftOut(notice.left_out)}`;
    return banner.stay(notice.failed === null ? results : `${results}: ${notice.failed}`, headset.presenting);
  }
  switch (notice.say) {
    case "move_closer":
      return say("Move closer to the surface");
    case "wait":
      return say("Wait: the robot is catching up");
    case "ready":
      return say("Go on");
    case "show_vehicle":
      robot.shown = true;
      return say("Slower: the robot is behind");
    case "hide_vehicle":
      robot.shown = false;
      return;
    case "queue_full":
      return say("The queue is full: wait for the robot");
  }
}

function binary(data: ArrayBuffer): void {
  stale = true;
  const kind = new Uint8Array(data, 0, 1)[0];
  if (kind === 1 && atlas && !wall) {
    wall = new Wall(readSurface(data), atlas);
    scene.add(wall.mesh);
    first.surface = performance.now();
  } else if (kind === 2) {
    const patch = readPatch(data);
    atlas?.update(patch);
    if (patch.picture === 0) {
      echo?.texels();
      delays.texels();
    }
  } else if (kind === 3) {
    watch?.update(readEntity(data));
  } else if (kind === 4) {
    void watch?.show(readPicture(data));
  }
}

/** What a key does beside moving; whether it does anything. */
function press(event: KeyboardEvent): boolean {
  if (event.repeat) return event.ctrlKey;
  const name = `${event.ctrlKey || event.metaKey ? "Ctrl " : ""}${event.code}`;
  switch (name) {
    case "KeyZ":
      if (wall) connection.command({ do: "undo" });
      return true;
    case "KeyP":
      pause(!tools.isPaused);
      return true;
    case "KeyR":
      if (wall) pause(!tools.isPaused);
      return true;
    case "Ctrl KeyS":
      if (wall) connection.command({ do: "save" });
      return true;
    case "Ctrl Enter":
      connection.command({ do: "end" });
      return true;
  }
  return false;
}

addEventListener("keydown", (event) => {
  if (press(event)) event.preventDefault();
  else if (!event.ctrlKey && !event.metaKey) cradle.keys.add(event.code);
});
addEventListener("keyup", (event) => cradle.keys.delete(event.code));
addEventListener("blur", () => cradle.keys.clear());

function resize(): void {
  stale = true;
  if (headset.presenting) return;
  renderer.setSize(innerWidth, innerHeight, false);
  camera.aspect = innerWidth / innerHeight;
  camera.updateProjectionMatrix();
}
addEventListener("resize", resize);
resize();

/** Where the gun is and what it does. */
function aim(wall: Wall): Mode {
  if (headset.presenting) {
    gun.visible = headset.update();
    gun.hold(headset.origin, headset.direction, wall);
    return headset.mode;
  }
  caster.setFromCamera(new THREE.Vector2(pointer.at.x, pointer.at.y), camera);
  gun.point(caster.ray.origin, caster.ray.direction, wall, tools.distance);
  gun.visible = gun.hit !== null;
  if (pointer.viewing || cradle.keys.has("KeyV")) return "viewing";
  return pointer.painting ? "painting" : "idle";
}

/** Sends what the hand does at a time, milliseconds; what it does. */
function publish(wall: Wall, time: number): Mode {
  let mode = aim(wall);
  if (mode === "painting" && tools.erasing) {
    if (gun.hit) connection.command({ do: "erase", point: gun.hit.point.toArray(), radius: ERASER });
    mode = "idle";
  }
  const nozzle = gun.pose;
  const here: State["cradle"] = { position: cradle.group.position.toArray(), heading: cradle.heading };
  const hand = JSON.stringify([mode, nozzle, here, pointer.pitch]);
  stale ||= hand !== held;
  held = hand;
  const sequence = connection.state({
    version: STATE_VERSION,
    time: begun + time / 1000,
    mode,
    nozzle,
    cradle: here,
    colour: tools.colour,
    flow: tools.flow,
  });
  if (mode === "painting" && gun.hit && sequence >= 0) {
    delays.hand(sequence, time);
    spray(wall, gun.hit, sequence, time);
  }
  return mode;
}

/** Shows the paint of a state before the server has it. */
function spray(wall: Wall, { uv }: Hit, sequence: number, time: number): void {
  const distance = tools.paintsFrom(gun.distance);
  if (distance === null || !echo) return;
  echo.spray({ sequence, time, uv, texel: wall.texel, distance, colour: tools.paint, flow: tools.flow });
  delays.guessed(time);
}

const clock = new THREE.Timer();
renderer.setAnimationLoop((time) => {
  clock.update(time);
  cradle.move(Math.min(clock.getDelta(), 0.1));
  if (!headset.presenting) camera.rotation.set(pointer.pitch, 0, 0);
  scene.updateMatrixWorld();
  // A pointer that moves speaks for itself: a frame between two of its places would hold it still, and the stroke would be dots. One that
  // rests is known until STILL ago: a later movement may have been made already, and the session leaves out what is older than its latest.
  const now = headset.presenting ? performance.now() : performance.now() - STILL;
  if (watch && headset.presenting) headset.update();
  if (wall && (headset.presenting || now > moved)) wall.project(publish(wall, now) === "viewing" ? robot.camera : null);
  if (echo?.tidy()) stale = true;
  if (drawing || !(stale || watch || headset.presenting)) return;
  stale = false;
  atlas?.upload(renderer);
  renderer.render(scene, camera);
  const gl = renderer.getContext() as WebGL2RenderingContext;
  delays.drawn(gl);
  if (!headset.presenting && (software || quality.due())) {
    drawing = software;
    const begun = performance.now();
    void rasterised(gl).then((now) => {
      drawing = false;
      if (quality.took(now - begun)) stale = true;
    });
  }
  if (wall && first.drawn === 0) {
    first.drawn = -1;
    void rasterised(gl).then((now) => (first.drawn = now));
  }
});

tools.hands(headset.swapped);
void Headset.available().then((available) => tools.headset(available));
navigator.xr?.addEventListener("devicechange", () => void Headset.available().then((found) => tools.headset(found)));

// For tests in a browser: what the page knows, and a way to lose the connection.
Object.assign(window, { paintcopter: { connection, headset, cradle, camera, delays, first, renderer, atlas: () => atlas, wall: () => wall, watch: () => watch } });
