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
  /** Times of each stage, milliseconds; then the sum to the server's texels on the screen, and to the page's own guess. */
  stages: Record<string, number[]> = {};
  private sequence = -1;
  private times: number[] = [];
  private guess = 0;

  constructor() {
    this.clear();
  }

  clear(): void {
    this.stages = { "hand to sent": [], "sent to answer": [], "answer to texels": [], "texels to picture": [], "hand to screen": [], "hand to guess": [] };
    [this.sequence, this.guess] = [-1, 0];
  }

  /** The hand paints with a state; followed if none is on its way. */
  hand(sequence: number, now: number): void {
    if (this.sequence >= 0 && now - (this.times[0] ?? 0) < LOST) return;
    [this.sequence, this.times] = [sequence, [now]];
  }

  /** The paint of a hand at a time is shown before the server has it. */
  guessed(time: number): void {
    if (this.guess === 0) this.guess = time;
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
    const guess = this.guess;
    const times = this.times.length === 4 && this.sequence >= 0 ? this.times : [];
    if (times.length === 0 && guess === 0) return;
    this.guess = 0;
    if (times.length > 0) this.sequence = -1;
    void rasterised(gl).then((now) => {
      if (guess > 0) this.keep(5, now - guess);
      if (times.length === 0) return;
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
