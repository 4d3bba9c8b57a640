// The robot as a ghost: body, rotors, arm, spray.
import * as THREE from "three";
import type { RobotState } from "./protocol";

const BODY = 0xd9662b;

export class Robot {
  readonly group = new THREE.Group();
  /** The robot's camera: it looks along the spray. */
  readonly camera = new THREE.PerspectiveCamera(50, 4 / 3, 0.05, 20);
  private latest = "";
  private readonly body = new THREE.Group();
  private readonly arm: THREE.Line;
  private readonly spray: THREE.Line;
  private readonly joint: THREE.Mesh;
  private readonly skin = new THREE.MeshLambertMaterial({ color: BODY, transparent: true, opacity: 0.35 });

  constructor() {
    const hull = new THREE.Mesh(new THREE.BoxGeometry(0.26, 0.26, 0.09), this.skin);
    this.body.add(hull);
    const ring = new THREE.TorusGeometry(0.12, 0.006, 6, 28);
    for (let k = 0; k < 6; k++) {
      const rotor = new THREE.Mesh(ring, this.skin);
      const turn = (Math.PI / 3) * (k + 0.5);
      rotor.position.set(0.27 * Math.cos(turn), 0.27 * Math.sin(turn), 0.05);
      this.body.add(rotor);
    }
    const line = (colour: number) =>
      new THREE.Line(
        new THREE.BufferGeometry().setAttribute("position", new THREE.BufferAttribute(new Float32Array(6), 3)),
        new THREE.LineBasicMaterial({ color: colour, transparent: true, opacity: 0.9 }),
      );
    this.arm = line(0x3a4650);
    this.spray = line(0x2f7de1);
    this.joint = new THREE.Mesh(new THREE.SphereGeometry(0.022), this.skin);
    for (const object of [this.arm, this.spray]) object.frustumCulled = false;
    this.group.add(this.body, this.arm, this.spray, this.joint);
    this.camera.up.set(0, 0, 1);
  }

  /** Whether it looks otherwise than before. */
  update(state: RobotState): boolean {
    const { position, rotation, nozzle, aim, spraying } = state;
    const before = this.latest;
    this.latest = JSON.stringify([position, rotation, nozzle, aim, spraying]);
    if (this.latest === before) return false;
    this.body.position.set(...state.position);
    this.body.quaternion.set(...state.rotation);
    this.joint.position.set(...state.nozzle);
    const draw = (line: THREE.Line, from: number[], to: number[]) => {
      (line.geometry.attributes.position as THREE.BufferAttribute).set([...from, ...to]).needsUpdate = true;
    };
    draw(this.arm, state.position, state.nozzle);
    draw(this.spray, state.nozzle, state.aim);
    this.spray.visible = state.spraying;
    this.camera.position.set(...state.nozzle);
    this.camera.lookAt(...state.aim);
    this.camera.updateMatrixWorld();
    return true;
  }

  /** Rule (d): a robot that is far behind is seen better. */
  set shown(on: boolean) {
    this.skin.opacity = on ? 0.9 : 0.35;
  }
}
