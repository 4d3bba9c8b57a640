// The spray gun: its pose as the server takes it, its ray and the point that it would hit.
import * as THREE from "three";
import type { State } from "./protocol";
import type { Hit, Wall } from "./wall";

// How far a mouse reaches, metres: from farther away the gun stays with the person, and the server asks to come closer.
const REACH = 3;
const FORWARD = new THREE.Vector3(1, 0, 0);

export class Gun {
  readonly group = new THREE.Group();
  hit: Hit | null = null;
  private readonly position = new THREE.Vector3();
  private readonly direction = new THREE.Vector3(1, 0, 0);
  private readonly ray: THREE.Line;
  private readonly spot: THREE.Mesh;

  constructor() {
    const geometry = new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3));
    this.ray = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: 0xffffff, transparent: true, opacity: 0.75 }));
    this.ray.frustumCulled = false;
    this.spot = new THREE.Mesh(
      new THREE.RingGeometry(0.8, 1, 40),
      new THREE.MeshBasicMaterial({ color: 0xffffff, transparent: true, opacity: 0.9, side: THREE.DoubleSide, depthTest: false }),
    );
    this.group.add(this.ray, this.spot);
  }

  /** A hand holds it: the ray is that of the controller. */
  hold(origin: THREE.Vector3, direction: THREE.Vector3, wall: Wall): void {
    this.position.copy(origin);
    this.direction.copy(direction);
    this.hit = wall.hit(origin, direction);
    this.draw(origin, 0.018);
  }

  /** A pointer directs it: the gun stands on the normal, as far off as the brush is wide. */
  point(eye: THREE.Vector3, direction: THREE.Vector3, wall: Wall, distance: number): void {
    this.hit = wall.hit(eye, direction);
    if (this.hit && this.hit.point.distanceTo(eye) <= REACH) {
      this.position.copy(this.hit.point).addScaledVector(this.hit.normal, distance);
      this.direction.copy(this.hit.normal).negate();
    } else {
      this.position.copy(eye);
      this.direction.copy(direction);
    }
    this.draw(this.position, 0.15 * distance);
  }

  /** How far it is from what it hits, metres. */
  get distance(): number {
    return this.hit ? this.position.distanceTo(this.hit.point) : Infinity;
  }

  set visible(on: boolean) {
    this.group.visible = on;
  }

  get pose(): State["nozzle"] {
    const rotation = new THREE.Quaternion().setFromUnitVectors(FORWARD, this.direction).normalize();
    return { translation: this.position.toArray(), rotation: [rotation.x, rotation.y, rotation.z, rotation.w] };
  }

  private draw(from: THREE.Vector3, radius: number): void {
    const end = this.hit?.point ?? from.clone().addScaledVector(this.direction, 2);
    (this.ray.geometry.attributes.position as THREE.BufferAttribute).set([...from.toArray(), ...end.toArray()]).needsUpdate = true;
    this.spot.visible = this.hit !== null;
    if (this.hit) {
      this.spot.position.copy(this.hit.point).addScaledVector(this.hit.normal, 0.003);
      this.spot.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), this.hit.normal);
      this.spot.scale.setScalar(Math.max(radius, 0.008));
    }
  }
}
