// The headset: the left controller moves the cradle, the right one is the gun.
import * as THREE from "three";
import type { Cradle } from "./cradle";
import type { Mode } from "./protocol";

// Places of the buttons in the WebXR gamepad mapping.
const TRIGGER = 0;
const SQUEEZE = 1;
const TOUCHPAD = 2;
const THUMBSTICK = 3;

// Where the browser keeps which button paints.
const KEPT = "paintcopter.paint-button";

function kept(): string | null {
  try {
    return localStorage.getItem(KEPT);
  } catch {
    return null;
  }
}

export class Headset {
  mode: Mode = "idle";
  /** As in the paper, the touchpad paints and the trigger views; swapped, the other way round. */
  swapped = kept() === "trigger";
  readonly origin = new THREE.Vector3();
  readonly direction = new THREE.Vector3();
  private readonly renderer: THREE.WebGLRenderer;
  private readonly cradle: Cradle;
  private readonly hands: THREE.Group[];

  constructor(renderer: THREE.WebGLRenderer, cradle: Cradle) {
    this.renderer = renderer;
    this.cradle = cradle;
    renderer.xr.enabled = true;
    renderer.xr.setReferenceSpaceType("local");
    const shape = new THREE.CylinderGeometry(0.012, 0.02, 0.16).rotateX(-Math.PI / 2).translate(0, 0, 0.06);
    const skin = new THREE.MeshLambertMaterial({ color: 0x46535e });
    this.hands = [0, 1].map((index) => {
      const hand = renderer.xr.getController(index);
      hand.add(new THREE.Mesh(shape, skin));
      cradle.group.add(hand);
      return hand;
    });
  }

  /** Lets the other button paint, now and whenever this browser comes back. */
  swap(): void {
    this.swapped = !this.swapped;
    try {
      localStorage.setItem(KEPT, this.swapped ? "trigger" : "touchpad");
    } catch {
      // A browser that keeps nothing: the choice holds as long as the page.
    }
  }

  get presenting(): boolean {
    return this.renderer.xr.isPresenting;
  }

  /** Whether this browser can show the session in a headset. */
  static async available(): Promise<boolean> {
    return (await navigator.xr?.isSessionSupported("immersive-vr").catch(() => false)) ?? false;
  }

  async enter(): Promise<void> {
    const session = await navigator.xr?.requestSession("immersive-vr", { optionalFeatures: ["local", "local-floor"] });
    if (session) await this.renderer.xr.setSession(session);
  }

  /** Reads the controllers; whether one of them is the gun. */
  update(): boolean {
    this.mode = "idle";
    this.cradle.wish = [0, 0, 0, 0];
    let armed = false;
    const sources = [...(this.renderer.xr.getSession()?.inputSources ?? [])];
    sources.forEach((source, index) => {
      const hand = this.hands[index];
      if (!source.gamepad || !hand) return;
      const down = (button: number) => source.gamepad?.buttons[button]?.pressed ?? false;
      const axes = source.gamepad.axes;
      // A thumbstick where there is one, else the touchpad.
      const [x, y] = axes.length >= 4 ? [axes[2], axes[3]] : [axes[0] ?? 0, axes[1] ?? 0];
      if (source.handedness === "left") {
        const still = (value: number) => (Math.abs(value) < 0.15 ? 0 : value);
        if (down(SQUEEZE)) this.cradle.wish = [0, -still(x), -still(y), 0];
        else this.cradle.wish = [-still(y), 0, 0, -still(x)];
        return;
      }
      armed = true;
      hand.getWorldPosition(this.origin);
      this.direction.set(0, 0, -1).transformDirection(hand.matrixWorld);
      const pad = down(TOUCHPAD) || down(THUMBSTICK);
      const [paint, view] = this.swapped ? [down(TRIGGER), pad] : [pad, down(TRIGGER)];
      this.mode = paint ? "painting" : view ? "viewing" : "idle";
    });
    return armed;
  }
}
