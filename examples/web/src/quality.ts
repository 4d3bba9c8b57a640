// How fine the picture is: what a machine without a graphics processor can draw in time is coarser.
import type { WebGLRenderer } from "three";

// Pictures whose time is looked at before it is judged, every how many of them is, and the time of one that is too long, milliseconds.
const PICTURES = 20;
const EVERY = 4;
const SLOW = 25;
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
  private drawn = 0;
  private looked = 0;
  private sum = 0;
  private readonly renderer: WebGLRenderer;

  constructor(renderer: WebGLRenderer) {
    this.renderer = renderer;
    renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
  }

  /** Whether the time of the picture that is drawn now should be told. */
  due(): boolean {
    return ++this.drawn % EVERY === 0;
  }

  /** Told how long a picture took, milliseconds; makes them coarser while they take too long. Whether it has. */
  took(time: number): boolean {
    this.sum += time;
    if (++this.looked < PICTURES) return false;
    const each = this.sum / this.looked;
    [this.looked, this.sum] = [0, 0];
    const ratio = this.renderer.getPixelRatio();
    if (each <= SLOW || ratio <= COARSEST) return false;
    this.renderer.setPixelRatio(Math.max(COARSEST, 0.75 * ratio));
    return true;
  }
}
