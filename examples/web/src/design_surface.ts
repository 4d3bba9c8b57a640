// The surface of a design: what is expected on it, the picture while it moves, and where a ray meets it.
import * as THREE from "three";
import { MeshBVH, acceleratedRaycast } from "three-mesh-bvh";
import type { Estimate, Placement, Surface } from "./design_protocol";

const vertexShader = `
  in vec2 place;
  out vec2 vUv;
  out vec2 vPlace;
  out vec3 vView;
  out vec3 vNormal;
  void main() {
    vUv = uv;
    vPlace = place;
    vNormal = normalMatrix * normal;
    vec4 view = modelViewMatrix * vec4(position, 1.0);
    vView = view.xyz;
    gl_Position = projectionMatrix * view;
  }`;

// Texels hold what the display shall show. Their fourth byte: 0 beside the surface, 85 out of reach, 170 clean, 255 painted.
const fragmentShader = `
  uniform sampler2D page;
  uniform vec2 pageSize;
  uniform sampler2D picture;
  uniform vec4 placement;
  uniform float aspect;
  uniform float shown;
  uniform float framed;
  in vec2 vUv;
  in vec2 vPlace;
  in vec3 vView;
  in vec3 vNormal;
  out vec4 colour;
  void main() {
    ivec2 texels = textureSize(page, 0);
    vec2 at = vec2(vUv.x, pageSize.y - vUv.y) / pageSize * vec2(texels) - 0.5;
    vec2 low = floor(at);
    vec4 sum = vec4(0.0);
    for (int k = 0; k < 4; k++) {
      vec2 corner = low + vec2(k & 1, k >> 1);
      vec4 texel = texelFetch(page, clamp(ivec2(corner), ivec2(0), texels - 1), 0);
      vec2 near = 1.0 - abs(at - corner);
      sum += vec4(texel.rgb, 1.0) * near.x * near.y * step(0.1, texel.a);
    }
    float code = texelFetch(page, clamp(ivec2(at + 0.5), ivec2(0), texels - 1), 0).a;
    vec3 base = sum.a > 0.0 ? sum.rgb / sum.a : vec3(0.8);
    float stripe = step(0.5, fract((gl_FragCoord.x + gl_FragCoord.y) / 9.0));
    if (code > 0.2 && code < 0.45) base = mix(base, vec3(0.85, 0.1, 0.45), 0.25 + 0.35 * stripe);
    if (code > 0.55 && code < 0.8) base = mix(base, vec3(0.3, 0.65, 0.95), 0.2 + 0.3 * stripe);
    float c = cos(placement.w), s = sin(placement.w);
    vec2 d = vPlace - placement.xy;
    vec2 within = vec2(c * d.x + s * d.y, c * d.y - s * d.x) / vec2(placement.z, placement.z / aspect) + 0.5;
    vec2 rim = min(within, 1.0 - within);
    if (min(rim.x, rim.y) >= 0.0) {
      vec4 over = texture(picture, within);
      base = mix(base, over.rgb, 0.85 * shown * over.a);
    }
    vec2 width = max(fwidth(within), 1e-6);
    float frame = min(abs(rim.x) / width.x, abs(rim.y) / width.y);
    if (framed > 0.5 && frame < 1.2 && min(rim.x / width.x, rim.y / width.y) > -1.3) base = vec3(0.85, 0.4, 0.17);
    float facing = abs(dot(normalize(vNormal), normalize(vView)));
    colour = vec4(base * (0.72 + 0.28 * facing), 1.0);
  }`;

export interface Met {
  point: THREE.Vector3;
  normal: THREE.Vector3;
  /** On the plane of pictures, metres; none on the rest. */
  place: [number, number] | null;
}

export class DesignSurface {
  readonly group = new THREE.Group();
  readonly data: Surface;
  private readonly painted: THREE.Mesh;
  private readonly rest: THREE.Mesh | null;
  private readonly uniforms: Record<string, THREE.IUniform>;
  private readonly caster = new THREE.Raycaster();

  constructor(data: Surface) {
    this.data = data;
    const blank = new THREE.DataTexture(new Uint8Array([200, 200, 200, 255]), 1, 1);
    blank.needsUpdate = true;
    this.uniforms = {
      page: { value: blank },
      pageSize: { value: new THREE.Vector2(1, 1) },
      picture: { value: blank },
      placement: { value: new THREE.Vector4(0, 0, 1, 0) },
      aspect: { value: 1 },
      shown: { value: 0 },
      framed: { value: 0 },
    };
    const geometry = indexed(data.positions, data.corners);
    geometry.setAttribute("uv", new THREE.BufferAttribute(data.uv, 2));
    geometry.setAttribute("place", new THREE.BufferAttribute(data.places, 2));
    const material = new THREE.ShaderMaterial({
      uniforms: this.uniforms, vertexShader, fragmentShader, side: THREE.DoubleSide, glslVersion: THREE.GLSL3,
    });
    this.painted = new THREE.Mesh(geometry, material);
    this.painted.raycast = acceleratedRaycast;
    this.group.add(this.painted);
    this.rest = null;
    if (data.restCorners.length > 0) {
      const grey = new THREE.MeshLambertMaterial({ color: 0xb4bcc2, side: THREE.DoubleSide });
      this.rest = new THREE.Mesh(indexed(data.restPositions, data.restCorners), grey);
      this.rest.raycast = acceleratedRaycast;
      this.group.add(this.rest);
    }
    this.caster.firstHitOnly = true;
  }

  /** What is expected of the texels. */
  expect({ rgba, texels, texel_m }: Estimate): void {
    const texture = new THREE.DataTexture(rgba, ...texels);
    texture.needsUpdate = true;
    (this.uniforms.page.value as THREE.Texture).dispose();
    this.uniforms.page.value = texture;
    (this.uniforms.pageSize.value as THREE.Vector2).set(texels[0] * texel_m, texels[1] * texel_m);
  }

  /** The picture itself, to be shown as long as nothing is expected of it. */
  set picture(texture: THREE.Texture) {
    this.uniforms.picture.value = texture;
  }

  place({ offset, size, rotate }: Placement, aspect: number): void {
    (this.uniforms.placement.value as THREE.Vector4).set(...offset, size, rotate);
    this.uniforms.aspect.value = aspect;
  }

  /** Whether the picture itself is seen, and its frame. */
  show(picture: boolean, frame: boolean): void {
    this.uniforms.shown.value = picture ? 1 : 0;
    this.uniforms.framed.value = frame ? 1 : 0;
  }

  /** Where a ray meets it. */
  meet(camera: THREE.Camera, at: THREE.Vector2): Met | null {
    this.caster.setFromCamera(at, camera);
    const found = this.caster.intersectObjects(this.group.children, false)[0];
    if (!found?.face) return null;
    // The side that is looked at.
    const normal = found.face.normal.clone();
    if (normal.dot(this.caster.ray.direction) > 0) normal.negate();
    if (found.object !== this.painted) return { point: found.point, normal, place: null };
    const position = this.painted.geometry.attributes.position as THREE.BufferAttribute;
    const { a, b, c } = found.face;
    const [p, q, r] = [a, b, c].map((k) => new THREE.Vector3().fromBufferAttribute(position, k)) as [THREE.Vector3, THREE.Vector3, THREE.Vector3];
    const share = THREE.Triangle.getBarycoord(found.point, p, q, r, new THREE.Vector3());
    if (!share) return null;
    const of = (axis: number) => [a, b, c].reduce((sum, k, n) => sum + share.getComponent(n) * (this.data.places[2 * k + axis] ?? 0), 0);
    return { point: found.point, normal, place: [of(0), of(1)] };
  }

  /** A picture that covers all of it. */
  extent(): Placement & { aspect: number } {
    const { places } = this.data;
    const [low, high] = [[Infinity, Infinity], [-Infinity, -Infinity]] as [[number, number], [number, number]];
    for (const [k, place] of places.entries()) {
      const axis = k % 2 as 0 | 1;
      [low[axis], high[axis]] = [Math.min(low[axis], place), Math.max(high[axis], place)];
    }
    const size = high[0] - low[0];
    return { offset: [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2], size, rotate: 0, aspect: size / (high[1] - low[1]) };
  }

  /** Its middle, its mean normal and its radius. */
  view(): { middle: THREE.Vector3; front: THREE.Vector3; radius: number } {
    const { geometry } = this.painted;
    geometry.computeBoundingSphere();
    const sphere = geometry.boundingSphere ?? new THREE.Sphere(new THREE.Vector3(), 1);
    const front = new THREE.Vector3();
    const [p, q, r] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    const { positions, corners } = this.data;
    for (let k = 0; k < corners.length; k += 3) {
      for (const [n, corner] of [p, q, r].entries()) corner.fromArray(positions, 3 * (corners[k + n] ?? 0));
      front.add(q.sub(p).cross(r.sub(p)));
    }
    front.z = 0;
    if (front.length() < 1e-6) front.set(-1, 0, 0);
    return { middle: sphere.center.clone(), front: front.normalize(), radius: sphere.radius };
  }

  dispose(): void {
    for (const mesh of [this.painted, this.rest]) {
      mesh?.geometry.dispose();
      (mesh?.material as THREE.Material | undefined)?.dispose();
    }
    (this.uniforms.page.value as THREE.Texture).dispose();
  }
}

function indexed(positions: Float32Array, corners: Uint32Array): THREE.BufferGeometry {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(positions, 3));
  geometry.setIndex(new THREE.BufferAttribute(corners.slice(), 1));
  geometry.computeVertexNormals();
  geometry.boundsTree = new MeshBVH(geometry, { indirect: true });
  return geometry;
}
