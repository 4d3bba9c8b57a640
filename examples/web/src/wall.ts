// The surface: its mesh, its paint, and where a ray meets it.
import * as THREE from "three";
import { MeshBVH, acceleratedRaycast } from "three-mesh-bvh";
import type { Atlas } from "./atlas";
import type { Surface } from "./protocol";

export interface Hit {
  point: THREE.Vector3;
  normal: THREE.Vector3;
}

export class Wall {
  readonly mesh: THREE.Mesh;
  private readonly caster = new THREE.Raycaster();
  private readonly uniforms: Record<string, THREE.IUniform>;

  constructor(surface: Surface, atlas: Atlas) {
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(surface.positions, 3));
    geometry.setAttribute("uv", new THREE.BufferAttribute(surface.uv, 2));
    // The hierarchy sorts the corners; they must be its own.
    geometry.setIndex(new THREE.BufferAttribute(surface.faces.slice(), 1));
    geometry.computeVertexNormals();
    geometry.boundsTree = new MeshBVH(geometry);
    const material = new THREE.MeshLambertMaterial({ map: atlas.textures[0], side: THREE.DoubleSide });
    this.uniforms = {
      flownMap: { value: atlas.textures[1] },
      flownShare: { value: 0 },
      robotView: { value: 0 },
      viewFromWorld: { value: new THREE.Matrix4() },
    };
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.uniforms);
      shader.vertexShader = shader.vertexShader
        .replace("#include <common>", "#include <common>\nvarying vec3 vWorld;")
        .replace("#include <begin_vertex>", "#include <begin_vertex>\nvWorld = (modelMatrix * vec4(position, 1.0)).xyz;");
      shader.fragmentShader = shader.fragmentShader
        .replace(
          "#include <common>",
          `#include <common>
          varying vec3 vWorld;
          uniform sampler2D flownMap;
          uniform float flownShare;
          uniform float robotView;
          uniform mat4 viewFromWorld;`,
        )
        .replace(
          "#include <map_fragment>",
          // What the robot's camera sees is thrown back onto the surface, with a frame about it.
          `#include <map_fragment>
          vec4 seenBy = viewFromWorld * vec4(vWorld, 1.0);
          vec2 inView = abs(seenBy.xy / seenBy.w);
          float inside = robotView * float(seenBy.w > 0.0 && max(inView.x, inView.y) < 1.0);
          float share = max(flownShare, inside);
          diffuseColor.rgb = mix(diffuseColor.rgb, texture2D(flownMap, vMapUv).rgb, share);
          float frame = inside * step(0.96, max(inView.x, inView.y));
          diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.1, 0.45, 0.9), frame);`,
        );
    };
    this.mesh = new THREE.Mesh(geometry, material);
    this.mesh.raycast = acceleratedRaycast;
    this.caster.firstHitOnly = true;
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
    return { point: found.point, normal: normal.clone().normalize() };
  }
}
