// A scene that is watched: the things of a run or a recording, each in its frame, and the camera's picture.
import * as THREE from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import type { Entity, EntityPart, Frame, Picture, Place } from "./protocol";

// Height of the camera's picture in the scene, and how far before the camera it hangs, metres.
const PICTURE = 0.3;
const AHEAD = 0.3;
// Pixels of a line that does not say how thick it is.
const THIN = 1;

export class Watch {
  /** The scene's own axes, however it lies on the page. */
  readonly group = new THREE.Group();
  /** What was drawn and taken away so far. */
  readonly counts = { entities: 0, removed: 0, pictures: 0 };
  private readonly frames = new Map<string, THREE.Group>();
  private readonly things = new Map<string, THREE.Group>();
  private readonly screen: THREE.Mesh<THREE.PlaneGeometry, THREE.MeshBasicMaterial>;

  constructor() {
    this.screen = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    // The picture's axes are those of the camera: x right, y down, z ahead.
    this.screen.rotation.x = Math.PI;
    this.screen.position.z = AHEAD;
  }

  place(place: Place): void {
    this.group.position.set(...place.position);
    this.group.quaternion.set(...place.rotation);
  }

  move(frames: Frame[]): void {
    for (const { name, position, rotation } of frames) {
      const frame = this.frame(name);
      if (frame.children.length === 0) frame.add(new THREE.AxesHelper(0.12));
      frame.position.set(...position);
      frame.quaternion.set(...rotation);
    }
  }

  keys(): Iterable<string> {
    return this.things.keys();
  }

  update(entity: Entity): void {
    const before = this.things.get(entity.key);
    before?.removeFromParent();
    before?.traverse((object) => {
      if (object instanceof THREE.Mesh) {
        object.geometry.dispose();
        (object.material as THREE.Material).dispose();
      }
    });
    this.things.delete(entity.key);
    if (entity.parts.length === 0) {
      this.counts.removed++;
      return;
    }
    const thing = new THREE.Group();
    thing.add(...entity.parts.map((part) => (part.lines ? lines(part) : triangles(part))));
    this.frame(entity.frame).add(thing);
    this.things.set(entity.key, thing);
    this.counts.entities++;
  }

  /** Hangs a picture before its camera; the browser decodes it meanwhile. */
  async show({ frame, format, data }: Picture): Promise<void> {
    const bitmap = await createImageBitmap(new Blob([data], { type: `image/${format}` }), { imageOrientation: "flipY" });
    const material = this.screen.material;
    material.map?.dispose();
    material.map = new THREE.Texture(bitmap);
    material.map.colorSpace = THREE.SRGBColorSpace;
    material.map.flipY = false;
    material.map.needsUpdate = true;
    material.needsUpdate = true;
    this.screen.scale.set((PICTURE * bitmap.width) / bitmap.height, PICTURE, 1);
    this.frame(frame).add(this.screen);
    this.counts.pictures++;
  }

  private frame(name: string): THREE.Group {
    let frame = this.frames.get(name);
    if (!frame) {
      frame = new THREE.Group();
      this.frames.set(name, frame);
      this.group.add(frame);
    }
    return frame;
  }
}

/** How opaque the least opaque vertex is: a part is drawn with one opacity. */
function opacity({ colours }: EntityPart): number {
  let least = 255;
  for (let k = 3; k < colours.length; k += 4) least = Math.min(least, colours[k]);
  return least / 255;
}

function triangles(part: EntityPart): THREE.Mesh {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(part.positions, 3));
  geometry.setAttribute("color", new THREE.BufferAttribute(linear(part.colours), 3, true));
  geometry.setIndex(new THREE.BufferAttribute(part.indices, 1));
  geometry.computeVertexNormals();
  const shown = opacity(part);
  const material = new THREE.MeshLambertMaterial({ vertexColors: true, side: THREE.DoubleSide, transparent: shown < 1, opacity: shown });
  return new THREE.Mesh(geometry, material);
}

function lines(part: EntityPart): LineSegments2 {
  const geometry = new LineSegmentsGeometry();
  geometry.setPositions(part.positions);
  geometry.setColors(Float32Array.from(linear(part.colours), (byte) => byte / 255));
  const shown = opacity(part);
  const material = new LineMaterial({
    vertexColors: true,
    worldUnits: !part.pixels,
    linewidth: part.thickness > 0 ? part.thickness : THIN,
    transparent: shown < 1,
    opacity: shown,
    // A line on a surface lies before it: paint.
    polygonOffset: true,
    polygonOffsetFactor: -8,
    polygonOffsetUnits: -64,
  });
  return new LineSegments2(geometry, material);
}

/** The renderer takes vertex colours as linear. */
function linear(colours: Uint8Array): Uint8Array {
  const out = new Uint8Array((colours.length / 4) * 3);
  const colour = new THREE.Color();
  for (let k = 0; k < colours.length / 4; k++) {
    colour.setRGB(colours[4 * k] / 255, colours[4 * k + 1] / 255, colours[4 * k + 2] / 255, THREE.SRGBColorSpace);
    out.set([colour.r, colour.g, colour.b].map((c) => Math.round(255 * c)), 3 * k);
  }
  return out;
}
