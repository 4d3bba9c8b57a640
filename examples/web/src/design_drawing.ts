// Lines that are drawn onto the picture of a design, or onto nothing.

type Pair = [number, number];

interface Line {
  /** Pixels from the upper left corner. */
  points: Pair[];
  width: number;
  colour: string;
}

/** Longer side of what is drawn on, pixels: of a picture at most, and of nothing. */
const [LONGEST, BLANK] = [4096, 2048];

export class Drawing {
  readonly canvas = document.createElement("canvas");
  private readonly below: ImageBitmap | null;
  private readonly lines: Line[] = [];

  /** On a picture whose lowest row comes first, or on nothing that is so much wider than high. */
  constructor(below: ImageBitmap | null, aspect: number) {
    this.below = below;
    const [width, height] = below ? [below.width, below.height] : aspect > 1 ? [BLANK, BLANK / aspect] : [BLANK * aspect, BLANK];
    const scale = Math.min(1, LONGEST / Math.max(width, height));
    [this.canvas.width, this.canvas.height] = [width, height].map((side) => Math.max(2, Math.round(scale * side))) as Pair;
    this.draw();
  }

  /** A line begins, `width` of the picture's width wide; places are shares of its sides, from the lower left corner. */
  begin(place: Pair, width: number, colour: string): void {
    this.lines.push({ points: [this.pixel(place)], width: width * this.canvas.width, colour });
    this.draw();
  }

  to(place: Pair): void {
    this.lines.at(-1)?.points.push(this.pixel(place));
    this.draw();
  }

  /** Takes the last line away. */
  undo(): void {
    this.lines.pop();
    this.draw();
  }

  /** Whether there would be something without the last line. */
  get canUndo(): boolean {
    return this.lines.length > (this.below ? 0 : 1);
  }

  async file(): Promise<ArrayBuffer> {
    const file = await new Promise<Blob | null>((found) => this.canvas.toBlob(found, "image/png"));
    if (!file) throw new Error("the picture is too large to be drawn on");
    return file.arrayBuffer();
  }

  private pixel([x, y]: Pair): Pair {
    return [x * this.canvas.width, (1 - y) * this.canvas.height];
  }

  private draw(): void {
    const { width, height } = this.canvas;
    const context = this.canvas.getContext("2d") as CanvasRenderingContext2D;
    context.clearRect(0, 0, width, height);
    if (this.below) {
      context.setTransform(1, 0, 0, -1, 0, height);
      context.drawImage(this.below, 0, 0, width, height);
      context.resetTransform();
    }
    [context.lineCap, context.lineJoin] = ["round", "round"];
    for (const { points, width, colour } of this.lines) {
      [context.lineWidth, context.strokeStyle] = [width, colour];
      context.beginPath();
      // A line of one point is a dot.
      for (const point of [points[0] as Pair, ...points]) context.lineTo(...point);
      context.stroke();
    }
  }
}
