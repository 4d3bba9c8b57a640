// Mouse, pen and touch: one pointer paints, the right button looks about, two fingers move.
import type { Cradle } from "./cradle";

export class Pointer {
  /** Place in the picture, -1 to 1, y up. */
  readonly at = { x: 0, y: 0 };
  painting = false;
  viewing = false;
  pitch = 0;
  private readonly fingers = new Map<number, { x: number; y: number }>();

  /** `moved` is told of every place where a pointer has been since the last frame, with its time in milliseconds. */
  constructor(canvas: HTMLCanvasElement, cradle: Cradle, moved: (time: number) => void) {
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      this.aim(canvas, event);
      moved(event.timeStamp);
      this.painting = event.button === 0 && this.fingers.size === 1;
      this.viewing = event.button === 1;
    });
    canvas.addEventListener("pointermove", (event) => {
      const before = this.fingers.get(event.pointerId);
      if (before) {
        const [dx, dy] = [event.clientX - before.x, event.clientY - before.y];
        if (this.fingers.size === 2) cradle.step(this.pinch(event), 0.004 * dx, 0.004 * dy);
        else if (event.buttons & 2) {
          cradle.heading += 0.004 * dx;
          this.pitch = Math.max(-1.4, Math.min(1.4, this.pitch + 0.004 * dy));
        }
        this.fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
      }
      for (const place of this.painting ? event.getCoalescedEvents() : []) {
        this.aim(canvas, place);
        moved(place.timeStamp);
      }
      this.aim(canvas, event);
    });
    const release = (event: PointerEvent) => {
      this.aim(canvas, event);
      moved(event.timeStamp);
      this.fingers.delete(event.pointerId);
      this.painting = false;
      this.viewing = false;
    };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      cradle.step(-0.0015 * event.deltaY, 0, 0);
    }, { passive: false });
  }

  private aim(canvas: HTMLCanvasElement, event: PointerEvent): void {
    const box = canvas.getBoundingClientRect();
    this.at.x = (2 * (event.clientX - box.left)) / box.width - 1;
    this.at.y = 1 - (2 * (event.clientY - box.top)) / box.height;
  }

  // How much two fingers come apart, as metres ahead.
  private pinch(event: PointerEvent): number {
    const other = [...this.fingers].find(([id]) => id !== event.pointerId)?.[1];
    const own = this.fingers.get(event.pointerId);
    if (!other || !own) return 0;
    const apart = (x: number, y: number) => Math.hypot(x - other.x, y - other.y);
    return 0.006 * (apart(event.clientX, event.clientY) - apart(own.x, own.y));
  }
}
