// Where the time goes between the hand and the screen: one state after the other is followed.

// Numbers that are kept of each stage, and time after which a state that came to nothing is left, milliseconds.
const MOST = 2000;
const LOST = 2000;

/** Resolves with the time at which everything drawn so far is in the picture, milliseconds. */
export function rasterised(gl: WebGL2RenderingContext): Promise<number> {
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  return new Promise((resolve) => {
    const look = () => {
      if (fence && gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) return void setTimeout(look, 1);
      gl.deleteSync(fence);
      resolve(performance.now());
    };
    look();
  });
}

export class Delays {
  /** Times of each stage, milliseconds; the last two are sums. */
  stages: Record<string, number[]> = {};
  private sequence = -1;
  private times: number[] = [];

  constructor() {
    this.clear();
  }

  clear(): void {
    this.stages = { "hand to sent": [], "sent to answer": [], "answer to texels": [], "texels to picture": [], "hand to screen": [] };
    this.sequence = -1;
  }

  /** The hand paints with a state; followed if none is on its way. */
  hand(sequence: number, now: number): void {
    if (this.sequence >= 0 && now - (this.times[0] ?? 0) < LOST) return;
    [this.sequence, this.times] = [sequence, [now]];
  }

  /** States before this one have left. */
  sent(before: number): void {
    this.pass(1, before);
  }

  /** The server has those before this one. */
  answered(before: number): void {
    this.pass(2, before);
  }

  /** Texels have come. */
  texels(): void {
    this.pass(3, Infinity);
  }

  /** A picture is drawn; `gl` tells when it is there. */
  drawn(gl: WebGL2RenderingContext): void {
    if (this.times.length !== 4 || this.sequence < 0) return;
    const times = this.times;
    this.sequence = -1;
    void rasterised(gl).then((now) => {
      [...times.slice(1), now].forEach((time, k) => this.keep(k, time - (times[k] ?? 0)));
      this.keep(4, now - (times[0] ?? 0));
    });
  }

  private pass(stage: number, before: number): void {
    if (this.sequence >= 0 && this.sequence < before && this.times.length === stage) this.times.push(performance.now());
  }

  private keep(stage: number, time: number): void {
    const kept = Object.values(this.stages)[stage];
    if (kept && kept.push(time) > MOST) kept.shift();
  }
}
