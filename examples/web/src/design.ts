// The page of `vr --design-page`: a picture on a surface, what stays clean, and what would come out.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { Drawing } from "./design_drawing";
import { Link } from "./design_link";
import { Panel } from "./design_panel";
import { ESTIMATE, SURFACE, readEstimate, readPicture, readSurface } from "./design_protocol";
import type { Change, Estimate, Placement, Reply } from "./design_protocol";
import { DesignSurface } from "./design_surface";
import type { Met } from "./design_surface";
import { drawsInSoftware } from "./quality";

// A pointer that moves less is a click, pixels; and the time after the last turn of a wheel until the change is sent, milliseconds.
const CLICK = 4;
const WHEEL = 150;

const main = document.querySelector("main") as HTMLElement;
const software = drawsInSoftware();
const canvas = document.getElementById("scene") as HTMLCanvasElement;
const renderer = new THREE.WebGLRenderer({ canvas, antialias: !software });
const scene = new THREE.Scene();
scene.background = new THREE.Color(0xdfe7ec);
scene.add(new THREE.HemisphereLight(0xffffff, 0x9a948c, 2.4));
const camera = new THREE.PerspectiveCamera(45, 1, 0.02, 500);
camera.up.set(0, 0, 1);
const controls = new OrbitControls(camera, canvas);
controls.addEventListener("change", draw);

let surface: DesignSurface | null = null;
let estimate: Estimate | null = null;
let texture: THREE.Texture | null = null;
let placement: (Placement & { aspect: number }) | null = null;
/** Where the pointer took the picture, and where the picture was. */
let grip: { from: [number, number]; offset: [number, number] } | null = null;
/** What lines are drawn on, and whether one is being drawn. */
let drawing: Drawing | null = null;
let draws = false;
let pressed: [number, number] | null = null;
let wheel = 0;
let due = false;

const panel = new Panel(send, draw, (file) => void drop(file), undoLine);
const link = new Link({ reply, binary, connected: (open, why) => panel.connected(open, why) });

function send(change: Change): void {
  if (!link.change(change)) return panel.say("not connected: try again");
  if (change.do !== "write" && change.do !== "end") panel.wait();
}

function reply(reply: Reply): void {
  switch (reply.type) {
    case "hello":
      return panel.hello(reply);
    case "state":
      // An answer to an earlier change must not move what is held.
      if (grip || draws || wheel || reply.number < link.latest) return;
      placement = reply.picture;
      panel.state(reply);
      return draw();
    case "error":
      return panel.say(reply.text);
    case "written":
      return panel.written(reply.mission);
    case "ended":
      panel.connected(false, `ended, report in ${reply.folder}`);
  }
}

function binary(data: ArrayBuffer): void {
  const kind = new Uint8Array(data, 0, 1)[0];
  if (kind === SURFACE) {
    const first = surface === null;
    if (surface) scene.remove(surface.group);
    surface?.dispose();
    surface = new DesignSurface(readSurface(data));
    if (texture) surface.picture = texture;
    scene.add(surface.group);
    panel.surface(surface.data);
    estimate = null;
    if (first) stand(surface);
  } else if (kind === ESTIMATE) {
    const found = readEstimate(data);
    if (found.surface !== surface?.data.surface) return;
    estimate = found;
    surface.expect(found);
    panel.estimate(found, found.number >= link.latest);
    draw();
    // It is on the screen with the next picture.
    requestAnimationFrame(() => setTimeout(() => link.answered(found.number)));
  } else {
    void show(new Blob([readPicture(data)]));
  }
  draw();
}

/** Looks at the middle of a surface from its front. */
function stand(surface: DesignSurface): void {
  const { middle, front, radius } = surface.view();
  const distance = (1.05 * radius) / Math.tan((0.5 * Math.min(camera.fov, camera.fov * camera.aspect) * Math.PI) / 180);
  camera.position.copy(middle).addScaledVector(front, distance).addScaledVector(camera.up, 0.1 * radius);
  controls.target.copy(middle);
  controls.update();
}

/** Draws the scene with the next picture of the screen. */
function draw(): void {
  if (due) return;
  due = true;
  requestAnimationFrame(() => {
    due = false;
    const { clientWidth, clientHeight } = main;
    const size = renderer.getSize(new THREE.Vector2());
    if (size.x !== clientWidth || size.y !== clientHeight) {
      renderer.setPixelRatio(software ? 1 : Math.min(devicePixelRatio, 2));
      renderer.setSize(clientWidth, clientHeight, false);
      camera.aspect = clientWidth / Math.max(1, clientHeight);
      camera.updateProjectionMatrix();
    }
    if (placement) surface?.place(placement, placement.aspect);
    const waits = grip !== null || draws || wheel !== 0 || (estimate?.number ?? -1) < link.latest;
    surface?.show(placement !== null && texture !== null && waits, placement !== null && panel.tool === "place");
    renderer.render(scene, camera);
  });
}
new ResizeObserver(draw).observe(main);

/** Takes a picture file. */
async function drop(file: File): Promise<void> {
  const bytes = await file.arrayBuffer();
  if (!(await show(new Blob([bytes])))) return panel.say(`${file.name}: is no picture: give a PNG or JPEG`);
  const refused = link.picture(file.name, bytes);
  if (refused) panel.say(refused);
  else panel.wait();
}

/** Makes a picture the one that is moved; whether it is one. */
async function show(file: Blob): Promise<boolean> {
  const bitmap = await createImageBitmap(file, { imageOrientation: "flipY", premultiplyAlpha: "none" }).catch(() => null);
  if (!bitmap) return false;
  drawing = null;
  panel.lines(false);
  const made = new THREE.Texture(bitmap);
  made.flipY = false;
  made.generateMipmaps = true;
  made.minFilter = THREE.LinearMipmapLinearFilter;
  use(made);
  return true;
}

/** Makes a texture the one that is moved. */
function use(made: THREE.Texture): void {
  texture?.dispose();
  texture = made;
  texture.needsUpdate = true;
  if (surface) surface.picture = texture;
  draw();
}

/** A line begins at a place: on the picture, or on all of the surface. */
function beginLine(surface: DesignSurface, place: [number, number]): void {
  placement ??= surface.extent();
  if (!drawing) {
    drawing = new Drawing((texture?.image as ImageBitmap | undefined) ?? null, placement.aspect);
    const made = new THREE.CanvasTexture(drawing.canvas);
    // It changes with every movement of the pointer.
    [made.generateMipmaps, made.minFilter] = [false, THREE.LinearFilter];
    use(made);
  }
  drawing.begin(onCanvas(placement, place), panel.pen.width / placement.size, panel.pen.colour);
  draws = true;
  redraw();
}

/** A place as shares of the picture's sides. */
function onCanvas({ offset, size, rotate, aspect }: Placement & { aspect: number }, place: [number, number]): [number, number] {
  const [x, y] = [place[0] - offset[0], place[1] - offset[1]];
  const [c, s] = [Math.cos(rotate), Math.sin(rotate)];
  return [(c * x + s * y) / size + 0.5, ((c * y - s * x) * aspect) / size + 0.5];
}

function redraw(): void {
  if (texture) texture.needsUpdate = true;
  draw();
}

function undoLine(): void {
  drawing?.undo();
  redraw();
  void sendLines();
}

/** The picture with its lines, where it lies. */
async function sendLines(): Promise<void> {
  const [drawn, lies] = [drawing, placement];
  if (!drawn || !lies) return;
  panel.lines(drawn.canUndo);
  const file = await drawn.file();
  if (drawing !== drawn) return;
  const refused = link.picture("drawn.png", file);
  if (refused) return panel.say(refused);
  // A new picture would lie as large as fits.
  placement = lies;
  sendPlacement();
}

const meet = (event: MouseEvent): Met | null => {
  const { left, top, width, height } = canvas.getBoundingClientRect();
  const at = new THREE.Vector2((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
  return surface?.meet(camera, at) ?? null;
};

/** Whether a place lies on the picture. */
function onPicture(place: [number, number] | null): place is [number, number] {
  if (!place || !placement || panel.tool !== "place") return false;
  const [x, y] = [place[0] - placement.offset[0], place[1] - placement.offset[1]];
  const [c, s] = [Math.cos(placement.rotate), Math.sin(placement.rotate)];
  return Math.abs(c * x + s * y) <= placement.size / 2 && Math.abs(c * y - s * x) <= placement.size / placement.aspect / 2;
}

function moved(change: Partial<Placement>): void {
  if (!placement) return;
  placement = { ...placement, ...change };
  panel.placing(placement);
  draw();
}

function sendPlacement(): void {
  if (placement) send({ do: "place", offset: placement.offset, size: placement.size, rotate: placement.rotate });
}

// Before the controls of the camera, which would take the pointer.
canvas.addEventListener("pointerdown", (event) => {
  pressed = [event.clientX, event.clientY];
  const met = event.button === 0 ? meet(event) : null;
  if (surface && met?.place && panel.tool === "line") beginLine(surface, met.place);
  else if (met && placement && onPicture(met.place)) grip = { from: met.place, offset: placement.offset };
  else return;
  controls.enabled = false;
  canvas.setPointerCapture(event.pointerId);
  event.stopImmediatePropagation();
}, { capture: true });

canvas.addEventListener("pointermove", (event) => {
  const met = grip || draws || event.buttons === 0 ? meet(event) : null;
  if (draws) {
    if (drawing && placement && met?.place) drawing.to(onCanvas(placement, met.place));
    return redraw();
  }
  if (!grip) {
    canvas.className = panel.tool !== "place" ? "mark" : met && onPicture(met.place) ? "place" : "";
    return;
  }
  if (!met?.place) return;
  moved({ offset: [grip.offset[0] + met.place[0] - grip.from[0], grip.offset[1] + met.place[1] - grip.from[1]] });
}, { capture: true });

canvas.addEventListener("pointerup", (event) => {
  const still = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < CLICK;
  pressed = null;
  if (grip) {
    grip = null;
    controls.enabled = true;
    if (!still) sendPlacement();
  } else if (draws) {
    [draws, controls.enabled] = [false, true];
    void sendLines();
  } else if (still && event.button === 0 && (panel.tool === "region" || panel.tool === "clean")) {
    const met = meet(event);
    if (met && surface) {
      const part = panel.part(met.point.toArray(), met.normal.toArray());
      send({ do: panel.tool === "region" ? "region" : "keep_clean", surface: surface.data.surface, part });
    }
  }
}, { capture: true });

canvas.addEventListener("pointercancel", () => {
  if (draws) void sendLines();
  [grip, draws, pressed, controls.enabled] = [null, false, null, true];
  draw();
});

canvas.addEventListener("wheel", (event) => {
  if (!placement || !onPicture(meet(event)?.place ?? null)) return;
  event.preventDefault();
  event.stopImmediatePropagation();
  // Browsers turn a wheel with Shift sideways.
  const turns = -(event.deltaY || event.deltaX) / 100;
  if (event.shiftKey) moved({ rotate: placement.rotate + (turns * Math.PI) / 36 });
  else moved({ size: Math.min(1000, Math.max(0.01, placement.size * 1.05 ** turns)) });
  clearTimeout(wheel);
  wheel = window.setTimeout(() => {
    wheel = 0;
    sendPlacement();
  }, WHEEL);
}, { capture: true, passive: false });

for (const name of ["dragenter", "dragover"]) {
  document.addEventListener(name, (event) => {
    event.preventDefault();
    main.classList.add("dropping");
  });
}
document.addEventListener("dragleave", (event) => {
  if (!event.relatedTarget) main.classList.remove("dropping");
});
document.addEventListener("drop", (event) => {
  event.preventDefault();
  main.classList.remove("dropping");
  const file = event.dataTransfer?.files[0];
  if (file) void drop(file);
});

// What the tests look at.
Object.assign(window, {
  design: {
    link,
    estimate: () => estimate,
    placement: () => placement,
    surface: () => surface,
    /** Where a point of the world is on the screen. */
    onScreen: (point: [number, number, number]) => {
      const { left, top, width, height } = canvas.getBoundingClientRect();
      const at = new THREE.Vector3(...point).project(camera);
      return [left + (width * (at.x + 1)) / 2, top + (height * (1 - at.y)) / 2];
    },
  },
});
