// How fine the picture is: what a machine without a graphics processor can draw in time is coarser.
import type { WebGLRenderer } from "three";

// Frames between two looks at the time, and the time of a frame that is too long, milliseconds.
const FRAMES = 20;
const SLOW = 45;
const COARSEST = 0.5;

/** Whether the browser draws on the processor. */
export function drawsInSoftware(): boolean {
  const probe = document.createElement("canvas").getContext("webgl2");
  const named = probe?.getExtension("WEBGL_debug_renderer_info");
  const name = named ? String(probe?.getParameter(named.UNMASKED_RENDERER_WEBGL)) : "";
  probe?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

export class Quality {
  private frames = 0;
  private since = 0;
  private readonly renderer: WebGLRenderer;

  constructor(renderer: WebGLRenderer) {
    this.renderer = renderer;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  }

  /** Told of every frame, with its time in milliseconds; makes the picture coarser while frames take too long. */
  frame(time: number): void {
    if (++this.frames < FRAMES) return;
    const each = (time - this.since) / this.frames;
    const ratio = this.renderer.getPixelRatio();
    if (this.since > 0 && each > SLOW && ratio > COARSEST) this.renderer.setPixelRatio(Math.max(COARSEST, 0.75 * ratio));
    this.frames = 0;
    this.since = time;
  }
}
