// The two pictures of the surface as textures that change in rectangles.
import * as THREE from "three";
import type { Patch, Triple } from "./protocol";

/** A rectangle of texels. */
export interface Rectangle {
  left: number;
  top: number;
  width: number;
  height: number;
}

/** One picture: its texels as the server has them, as they are shown, and on the graphics processor. */
export class Picture {
  readonly texture: THREE.DataTexture;
  readonly width: number;
  readonly height: number;
  private readonly truth: Uint8Array;
  private readonly shown: Uint8Array<ArrayBuffer>;
  // The shown texels under a name that the renderer does not know: what it copies rectangles from.
  private readonly source: THREE.DataTexture;
  private readonly changed = new THREE.Box2();

  constructor(width: number, height: number) {
    [this.width, this.height] = [width, height];
    this.truth = new Uint8Array(4 * width * height).fill(255);
    this.shown = this.truth.slice();
    const texture = () => new THREE.DataTexture(this.shown, width, height);
    [this.texture, this.source] = [texture(), texture()];
    // They hold what the display shall show: no colour space is converted.
    this.texture.magFilter = this.texture.minFilter = THREE.LinearFilter;
    this.texture.needsUpdate = true;
  }

  /** Takes texels of the server. */
  write(patch: Patch): void {
    for (let row = 0; row < patch.height; row++) {
      let to = 4 * ((patch.top + row) * this.width + patch.left);
      let from = 3 * row * patch.width;
      for (let column = 0; column < patch.width; column++, to += 4, from += 3) {
        this.truth[to] = patch.rgb[from] ?? 0;
        this.truth[to + 1] = patch.rgb[from + 1] ?? 0;
        this.truth[to + 2] = patch.rgb[from + 2] ?? 0;
      }
    }
    this.restore(patch);
  }

  /** Shows what the server has. */
  restore({ left, top, width, height }: Rectangle): void {
    for (let row = top; row < top + height; row++) {
      const at = 4 * (row * this.width + left);
      this.shown.set(this.truth.subarray(at, at + 4 * width), at);
    }
    this.touch({ left, top, width, height });
  }

  /** Mixes a colour into what is shown, each texel by the share that `share` has for it. */
  stain(rectangle: Rectangle, colour: Triple, share: (column: number, row: number) => number): void {
    const { left, top, width, height } = rectangle;
    for (let row = top; row < top + height; row++) {
      for (let column = left; column < left + width; column++) {
        const at = 4 * (row * this.width + column);
        const part = share(column, row);
        for (let c = 0; c < 3; c++) this.shown[at + c] = (1 - part) * (this.shown[at + c] ?? 0) + part * (colour[c] ?? 0);
      }
    }
    this.touch(rectangle);
  }

  /** Uploads the rectangle about all that has changed, at once. */
  upload(renderer: THREE.WebGLRenderer): void {
    if (this.changed.isEmpty()) return;
    renderer.copyTextureToTexture(this.source, this.texture, this.changed, this.changed.min);
    this.changed.makeEmpty();
  }

  private touch({ left, top, width, height }: Rectangle): void {
    this.changed.expandByPoint(new THREE.Vector2(left, top)).expandByPoint(new THREE.Vector2(left + width, top + height));
  }
}

export class Atlas {
  /** What the person sees, and what the robot has sprayed. */
  readonly pictures: [Picture, Picture];

  constructor(width: number, height: number) {
    this.pictures = [new Picture(width, height), new Picture(width, height)];
  }

  update(patch: Patch): void {
    this.pictures[patch.picture === 0 ? 0 : 1].write(patch);
  }

  /** To be called before the pictures are drawn. */
  upload(renderer: THREE.WebGLRenderer): void {
    for (const picture of this.pictures) picture.upload(renderer);
  }
}
