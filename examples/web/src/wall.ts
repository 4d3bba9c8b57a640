// The surface: its mesh, its paint, and where a ray meets it.
import * as THREE from "three";
import { MeshBVH, acceleratedRaycast } from "three-mesh-bvh";
import type { Atlas } from "./atlas";
import { BRIGHTEST, baked } from "./light";
import type { Surface } from "./protocol";

const vertexShader = `
  attribute vec3 light;
  varying vec2 vUv;
  varying vec3 vLight;
  varying vec3 vWorld;
  void main() {
    vUv = uv;
    vLight = ${BRIGHTEST} * light;
    vWorld = position;
    gl_Position = projectionMatrix * (modelViewMatrix * vec4(position, 1.0));
  }`;

// Pictures are what the display shall show, and so is the light: nothing is decoded and encoded again for every pixel.
const fragmentShader = `
  uniform sampler2D map;
  uniform sampler2D flownMap;
  uniform float flownShare;
  uniform float robotView;
  uniform mat4 viewFromWorld;
  varying vec2 vUv;
  varying vec3 vLight;
  varying vec3 vWorld;
  void main() {
    vec3 colour = texture2D(map, vUv).rgb;
    if (flownShare + robotView > 0.0) {
      // What the robot's camera sees is thrown back onto the surface, with a frame about it.
      vec4 seenBy = viewFromWorld * vec4(vWorld, 1.0);
      vec2 inView = abs(seenBy.xy / seenBy.w);
      float inside = robotView * float(seenBy.w > 0.0 && max(inView.x, inView.y) < 1.0);
      colour = mix(colour, texture2D(flownMap, vUv).rgb, max(flownShare, inside));
      colour = mix(colour, vec3(0.35, 0.70, 0.95), inside * step(0.96, max(inView.x, inView.y)));
    }
    gl_FragColor = vec4(colour * vLight, 1.0);
  }`;

export interface Hit {
  point: THREE.Vector3;
  normal: THREE.Vector3;
  uv: THREE.Vector2;
}

export class Wall {
  readonly mesh: THREE.Mesh;
  /** Metres of a texel. */
  readonly texel: number;
  private readonly caster = new THREE.Raycaster();
  private readonly uniforms: Record<string, THREE.IUniform>;

  constructor(surface: Surface, atlas: Atlas) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(surface.positions, 3));
    geometry.setAttribute("uv", new THREE.BufferAttribute(surface.uv, 2));
    // The hierarchy sorts the corners; they must be its own.
    geometry.setIndex(new THREE.BufferAttribute(surface.faces.slice(), 1));
    geometry.computeVertexNormals();
    geometry.boundsTree = new MeshBVH(geometry, { indirect: true });
    geometry.setAttribute("light", baked(geometry.attributes.normal as THREE.BufferAttribute));
    geometry.deleteAttribute("normal");
    this.uniforms = {
      map: { value: atlas.pictures[0].texture },
      flownMap: { value: atlas.pictures[1].texture },
      flownShare: { value: 0 },
      robotView: { value: 0 },
      viewFromWorld: { value: new THREE.Matrix4() },
    };
    const material = new THREE.ShaderMaterial({ uniforms: this.uniforms, vertexShader, fragmentShader, side: THREE.DoubleSide });
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.raycast = acceleratedRaycast;
    this.caster.firstHitOnly = true;
    const { width, height } = atlas.pictures[0];
    this.texel = Math.sqrt(areas(surface) / (width * height));
  }

  /** Shows all of the robot's own paint, or not. */
  set flown(on: boolean) {
    this.uniforms.flownShare.value = on ? 1 : 0;
  }

  /** Throws the picture of the robot's camera onto the surface; `null` does not. */
  project(camera: THREE.PerspectiveCamera | null): void {
    this.uniforms.robotView.value = camera ? 1 : 0;
    if (camera) {
      const matrix = this.uniforms.viewFromWorld.value as THREE.Matrix4;
      matrix.multiplyMatrices(camera.projectionMatrix, camera.matrixWorldInverse);
    }
  }

  hit(origin: THREE.Vector3, direction: THREE.Vector3): Hit | null {
    this.caster.set(origin, direction);
    const found = this.caster.intersectObject(this.mesh, false)[0];
    if (!found?.face) return null;
    const normal = found.normal ?? found.face.normal;
    return { point: found.point, normal: normal.clone().normalize(), uv: found.uv ?? new THREE.Vector2() };
  }
}

/** Area of the surface over that of its texture coordinates. */
function areas({ positions, uv, faces }: Surface): number {
  const [a, b] = [new THREE.Vector3(), new THREE.Vector3()];
  let [surface, texture] = [0, 0];
  const side = (out: THREE.Vector3, data: Float32Array, items: number, from: number, to: number) =>
    out.set(...[0, 1, 2].map((k) => (k < items ? (data[items * to + k] ?? 0) - (data[items * from + k] ?? 0) : 0)) as [number, number, number]);
  for (let k = 0; k < faces.length; k += 3) {
    const [p, q, r] = [faces[k] ?? 0, faces[k + 1] ?? 0, faces[k + 2] ?? 0];
    surface += side(a, positions, 3, p, q).cross(side(b, positions, 3, p, r)).length();
    texture += side(a, uv, 2, p, q).cross(side(b, uv, 2, p, r)).length();
  }
  return surface / texture;
}
