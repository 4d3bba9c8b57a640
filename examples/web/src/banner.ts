// Notices: a line on the page, and in the headset a sign before the eyes.
import * as THREE from "three";

const SHOWN = 3500;

export class Banner {
  readonly sign: THREE.Mesh;
  private readonly line: HTMLElement;
  private readonly canvas = document.createElement("canvas");
  private readonly texture: THREE.CanvasTexture;
  private timer = 0;
  private last = false;

  constructor(line: HTMLElement) {
    this.line = line;
    this.canvas.width = 1024;
    this.canvas.height = 128;
    this.texture = new THREE.CanvasTexture(this.canvas);
    this.texture.colorSpace = THREE.SRGBColorSpace;
    const material = new THREE.MeshBasicMaterial({ map: this.texture, transparent: true, depthTest: false });
    this.sign = new THREE.Mesh(new THREE.PlaneGeometry(0.8, 0.1), material);
    this.sign.position.set(0, 0.22, -1.2);
    this.sign.renderOrder = 10;
    this.sign.visible = false;
  }

  say(text: string, headset: boolean): void {
    this.show(text, headset, false);
  }

  /** The last words: they stay. */
  stay(text: string, headset: boolean): void {
    this.show(text, headset, true);
    this.last = true;
  }

  private show(text: string, headset: boolean, stays: boolean): void {
    if (this.last) return;
    this.line.textContent = text;
    this.line.classList.add("on");
    const pen = this.canvas.getContext("2d");
    if (pen) {
      pen.clearRect(0, 0, 1024, 128);
      pen.fillStyle = "rgba(38, 49, 58, 0.88)";
      pen.fillRect(0, 0, 1024, 128);
      pen.fillStyle = "#fff";
      pen.font = "46px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.textBaseline = "middle";
      pen.fillText(text, 512, 66, 990);
      this.texture.needsUpdate = true;
    }
    this.sign.visible = headset;
    clearTimeout(this.timer);
    this.timer = stays ? 0 : window.setTimeout(() => {
      this.line.classList.remove("on");
      this.sign.visible = false;
    }, SHOWN);
  }
}
