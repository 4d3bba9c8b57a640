// The two pictures of the surface as textures that change in rectangles.
import * as THREE from "three";
import type { Patch } from "./protocol";

export class Atlas {
  readonly textures: [THREE.DataTexture, THREE.DataTexture];
  private readonly width: number;

  constructor(width: number, height: number) {
    this.width = width;
    const make = () => {
      const texture = new THREE.DataTexture(new Uint8Array(4 * width * height).fill(255), width, height);
      texture.colorSpace = THREE.SRGBColorSpace;
      texture.magFilter = THREE.LinearFilter;
      texture.minFilter = THREE.LinearFilter;
      texture.needsUpdate = true;
      return texture;
    };
    this.textures = [make(), make()];
  }

  /** Takes a rectangle and uploads no more than its rows. */
  update(patch: Patch): void {
    const texture = this.textures[patch.picture === 0 ? 0 : 1];
    const data = texture.image.data as Uint8Array;
    for (let row = 0; row < patch.height; row++) {
      let to = 4 * ((patch.top + row) * this.width + patch.left);
      let from = 3 * row * patch.width;
      for (let column = 0; column < patch.width; column++, to += 4, from += 3) {
        data[to] = patch.rgb[from];
        data[to + 1] = patch.rgb[from + 1];
        data[to + 2] = patch.rgb[from + 2];
      }
      texture.addUpdateRange(4 * ((patch.top + row) * this.width + patch.left), 4 * patch.width);
    }
    texture.needsUpdate = true;
  }
}
