// The light of the scene: sky, ground and a sun. It never moves, so what stands still is lit once.
import * as THREE from "three";

const SKY = { colour: new THREE.Color(0xf4f8ff), ground: new THREE.Color(0x8d7f70), strength: 1.9 };
const SUN = { colour: new THREE.Color(0xfff1dd), strength: 1.7 };
// The display's gamma, and the light that a byte of 255 stands for: more than the brightest there is.
const GAMMA = 2.2;
export const BRIGHTEST = 1.25;

export const sky = new THREE.HemisphereLight(SKY.colour, SKY.ground, SKY.strength);
sky.position.set(0, 0, 1);
export const sun = new THREE.DirectionalLight(SUN.colour, SUN.strength);

/** The factor by which light changes the display's values of a matt surface, red, green and blue of every normal, as bytes. */
export function baked(normals: THREE.BufferAttribute | THREE.InterleavedBufferAttribute): THREE.BufferAttribute {
  const towards = sun.position.clone().normalize();
  const bytes = new Uint8Array(4 * normals.count);
  const normal = new THREE.Vector3();
  const colour = new THREE.Color();
  const ray = new THREE.Color();
  for (let k = 0; k < normals.count; k++) {
    normal.fromBufferAttribute(normals, k);
    colour.copy(SKY.ground).lerp(SKY.colour, 0.5 + 0.5 * normal.z).multiplyScalar(SKY.strength);
    colour.add(ray.copy(SUN.colour).multiplyScalar(SUN.strength * Math.max(0, normal.dot(towards))));
    for (const [c, irradiance] of colour.toArray().entries()) {
      bytes[4 * k + c] = Math.min(255, Math.round((255 / BRIGHTEST) * (irradiance / Math.PI) ** (1 / GAMMA)));
    }
  }
  return new THREE.BufferAttribute(bytes, 4, true);
}
