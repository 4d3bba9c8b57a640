// The cradle in which the person stands: four degrees of freedom, and the way from the page's axes (y up) to the world's (z up).
import * as THREE from "three";

// Metres and radians per second.
const SPEED = 1.1;
const TURN = 1.0;

export class Cradle {
  readonly group = new THREE.Group();
  heading = 0;
  readonly keys = new Set<string>();
  /** Wishes of a controller: ahead, left, up, turn to the left, each -1 to 1. */
  wish: [number, number, number, number] = [0, 0, 0, 0];

  constructor() {
    const rail = new THREE.MeshLambertMaterial({ color: 0x8a99a5, transparent: true, opacity: 0.7 });
    const bar = (x: number, y: number, z: number, at: [number, number, number]) => {
      const mesh = new THREE.Mesh(new THREE.BoxGeometry(x, y, z), rail);
      mesh.position.set(...at);
      this.group.add(mesh);
    };
    // In the page's axes: x right, y up, z back; the head is the origin.
    bar(1.1, 0.04, 0.9, [0, -1.62, 0]);
    for (const z of [-0.45, 0.45]) bar(1.1, 0.04, 0.04, [0, -0.75, z]);
    for (const x of [-0.55, 0.55]) {
      bar(0.04, 0.04, 0.9, [x, -0.75, 0]);
      for (const z of [-0.45, 0.45]) bar(0.04, 0.87, 0.04, [x, -1.18, z]);
    }
  }

  place(position: [number, number, number], heading: number): void {
    this.group.position.set(...position);
    this.heading = heading;
    this.turn();
  }

  move(seconds: number): void {
    const pressed = (plus: string, minus: string) => Number(this.keys.has(plus)) - Number(this.keys.has(minus));
    const [ahead, left, up, turn] = this.wish;
    const go = [ahead + pressed("KeyW", "KeyS"), left + pressed("KeyA", "KeyD"), up + pressed("KeyE", "KeyQ")];
    this.step(SPEED * seconds * go[0], SPEED * seconds * go[1], SPEED * seconds * go[2]);
    this.heading += TURN * seconds * (turn + pressed("ArrowLeft", "ArrowRight"));
    this.turn();
  }

  step(ahead: number, left: number, up: number): void {
    const [cos, sin] = [Math.cos(this.heading), Math.sin(this.heading)];
    const position = this.group.position;
    position.x += ahead * cos - left * sin;
    position.y += ahead * sin + left * cos;
    position.z = Math.max(0.3, position.z + up);
  }

  turn(): void {
    const upright = new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(1, 0, 0), Math.PI / 2);
    this.group.quaternion
      .setFromAxisAngle(new THREE.Vector3(0, 0, 1), this.heading - Math.PI / 2)
      .multiply(upright);
  }
}
