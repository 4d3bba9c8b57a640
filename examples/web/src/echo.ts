// Paint of the hand that the server has not simulated yet: a guess, shown at once and replaced by the server's texels when they come.
import type { Picture, Rectangle } from "./atlas";
import type { Triple } from "./protocol";

// Thickness of which a film lets a third of the light through, metres, and the longest time that one state sprays, seconds.
const FILM = 20e-6;
const LONGEST = 0.05;
// Radius of a spot in deviations, and its deviation at one metre from the gun, metres.
const CUT = 2.5;
const SPREAD = 0.15;
// Time after which a guess that no texels have answered is taken back, milliseconds.
const LOST = 300;

interface Spot extends Rectangle {
  sequence: number;
  since: number;
  colour: Triple;
  share: (column: number, row: number) => number;
}

/** What the gun does at one place. */
export interface Spray {
  /** Number of its state and its time, milliseconds. */
  sequence: number;
  time: number;
  /** Texture coordinates, metres of a texel, and of the gun's distance. */
  uv: { x: number; y: number };
  texel: number;
  distance: number;
  colour: Triple;
  /** Cubic metres a second. */
  flow: number;
}

export class Echo {
  private spots: Spot[] = [];
  private answered = 0;
  private before = 0;
  private readonly picture: Picture;

  constructor(picture: Picture) {
    this.picture = picture;
  }

  spray({ sequence, time, uv, texel, distance, colour, flow }: Spray): void {
    const seconds = Math.min(LONGEST, (time - this.before) / 1000);
    this.before = time;
    const deviation = SPREAD * distance;
    const thickness = (flow * seconds) / (2 * Math.PI * deviation ** 2);
    const [x, y] = [uv.x * this.picture.width - 0.5, uv.y * this.picture.height - 0.5];
    const radius = (CUT * deviation) / texel;
    const [left, top] = [Math.max(0, Math.ceil(x - radius)), Math.max(0, Math.ceil(y - radius))];
    const width = Math.min(this.picture.width, Math.floor(x + radius) + 1) - left;
    const height = Math.min(this.picture.height, Math.floor(y + radius) + 1) - top;
    if (width <= 0 || height <= 0) return;
    const falloff = texel ** 2 / (2 * deviation ** 2);
    const share = (column: number, row: number) => {
      const off = (column - x) ** 2 + (row - y) ** 2;
      return 1 - Math.exp((-thickness / FILM) * Math.exp(-falloff * off));
    };
    const spot = { sequence, since: performance.now(), colour, share, left, top, width, height };
    this.spots.push(spot);
    this.picture.stain(spot, colour, share);
  }

  /** The server has the states before this one: the next texels have their paint. */
  answer(before: number): void {
    this.answered = before;
  }

  /** Texels have come: what they answer is no guess any more, the rest is shown on top of them. */
  texels(): void {
    this.settle((spot) => spot.sequence < this.answered);
  }

  /** To be called from time to time: a guess that nothing answers was none of the session. Whether there was one. */
  tidy(): boolean {
    const late = performance.now() - LOST;
    const found = this.spots.some((spot) => spot.since < late);
    if (found) this.settle((spot) => spot.since < late);
    return found;
  }

  private settle(over: (spot: Spot) => boolean): void {
    for (const spot of this.spots) this.picture.restore(spot);
    this.spots = this.spots.filter((spot) => !over(spot));
    for (const spot of this.spots) this.picture.stain(spot, spot.colour, spot.share);
  }
}
