// The panel beside the surface of a design: what is chosen, and what it comes to.
import type { Change, Estimate, Hello, Part, Placement, State, Surface } from "./design_protocol";

export type Tool = "place" | "region" | "clean" | "line";

const KEYS: Record<Tool, string> = {
  place: "drag the picture: move · wheel on it: size, with Shift: turn · drag beside it: look around · right button: shift · wheel beside it: nearer",
  region: "click: paint this part only · drag: look around",
  clean: "click: this part stays clean · drag: look around",
  line: "drag on the surface: draw a line · drag beside it: look around",
};
const PALETTES: Record<string, string> = {
  six: "six: white, black, 4 hues",
  cmyk: "cyan, magenta, yellow, black",
};

const element = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;
const input = (id: string): HTMLInputElement => element(id);
const text = (id: string, words: string) => (element(id).textContent = words);

const minutes = (seconds: number) => `${(seconds / 60).toFixed(seconds < 600 ? 1 : 0)} min`;
const duration = (seconds: number) =>
  seconds < 3600 ? minutes(seconds) : `${Math.floor(seconds / 3600)} h ${String(Math.round((seconds % 3600) / 60) % 60).padStart(2, "0")}`;
const percent = (share: number) => `${(100 * share).toFixed(1)} %`;
const litres = (volume: number) => volume.toFixed(volume < 0.1 ? 3 : 2);

export class Panel {
  private chosen: Tool = "place";
  private placement: Placement | null = null;
  private hide = 0;
  private readonly send: (change: Change) => void;

  /** `send` hears what is chosen, `tool` that a click does something else, `undoLine` that the last line goes. */
  constructor(send: (change: Change) => void, tool: () => void, file: (file: File) => void, undoLine: () => void) {
    this.send = send;
    element("undo-line").onclick = undoLine;
    for (const button of document.querySelectorAll<HTMLButtonElement>("[data-tool]")) {
      button.onclick = () => {
        this.tool = button.dataset.tool as Tool;
        tool();
      };
    }
    for (const id of ["size", "angle", "right", "up"]) input(id).onchange = () => this.typed();
    input("palette").onchange = () => send({ do: "palette", name: input("palette").value });
    input("wall").onchange = () => send({ do: "wall", name: input("wall").value || null });
    element("whole").onclick = () => send({ do: "whole_surface" });
    element("undo").onclick = () => send({ do: "undo_clean" });
    element("write").onclick = () => send({ do: "write" });
    element("end").onclick = () => send({ do: "end" });
    input("file").onchange = () => {
      const chosen = input("file").files?.[0];
      if (chosen) file(chosen);
      // The same file may be chosen again.
      input("file").value = "";
    };
    this.tool = "place";
  }

  get tool(): Tool {
    return this.chosen;
  }

  private set tool(tool: Tool) {
    this.chosen = tool;
    for (const button of document.querySelectorAll<HTMLButtonElement>("[data-tool]")) {
      button.setAttribute("aria-checked", String(button.dataset.tool === tool));
    }
    const marks = tool === "region" || tool === "clean";
    for (const [id, shown] of [["how", marks], ["pen", tool === "line"]] as const) {
      element(id).hidden = !shown;
      element(id).style.display = shown ? "" : "none";
    }
    text("keys", KEYS[tool]);
  }

  /** The part about a point that a click marks. */
  part(point: [number, number, number], normal: [number, number, number]): Part {
    if (input("part").value === "pick") return { kind: "pick", point };
    return { kind: "disc", point, normal, radius: Number(input("radius").value) };
  }

  /** Colour and width, metres, of the next line. */
  get pen(): { colour: string; width: number } {
    return { colour: input("colour").value, width: Math.max(0.001, input("line-width").valueAsNumber || 0) };
  }

  /** Whether the last line may go. */
  lines(canUndo: boolean): void {
    (element("undo-line") as HTMLButtonElement).disabled = !canUndo;
  }

  connected(open: boolean, why: string): void {
    element("dot").classList.toggle("on", open);
    text("connection", why);
  }

  hello({ name, palettes, walls }: Hello): void {
    document.title = `PaintCopter: ${name}`;
    text("name", name);
    const words = (palette: string) =>
      PALETTES[palette] ?? palette.replace(/^spot:1$/, "best single paint").replace(/^spot:(\d+)$/, "best $1 for the picture").replace(/^one:/, "only ");
    element("palette").replaceChildren(...palettes.map((palette) => new Option(words(palette), palette)));
    element("wall").replaceChildren(new Option("as usual", ""), ...walls.map((wall) => new Option(wall === "mesh" ? "colours of the mesh" : wall, wall)));
  }

  state({ picture, palette, wall, region, keep_clean }: State): void {
    this.placing(picture);
    text("picture", picture ? picture.name : "none yet");
    text("hint", picture ? "" : "Drop a PNG or JPEG on the surface");
    input("palette").value = palette;
    input("wall").value = wall ?? "";
    input("wall").disabled = palette.startsWith("one:");
    const clean = keep_clean.length === 0 ? "" : ` ${keep_clean.length} kept clean.`;
    text("parts", (region === null ? "All of it is painted." : "A part is painted.") + clean);
    (element("whole") as HTMLButtonElement).disabled = region === null;
    (element("undo") as HTMLButtonElement).disabled = keep_clean.length === 0;
    (element("write") as HTMLButtonElement).disabled = picture === null;
  }

  /** Where the picture is. */
  placing(placement: Placement | null): void {
    this.placement = placement;
    const values = placement && {
      size: placement.size, angle: (placement.rotate * 180) / Math.PI, right: placement.offset[0], up: placement.offset[1],
    };
    for (const id of ["size", "angle", "right", "up"] as const) {
      input(id).disabled = !values;
      input(id).value = values ? String(Number(values[id].toFixed(id === "angle" ? 1 : 3))) : "";
    }
  }

  private typed(): void {
    const [size, angle, right, up] = ["size", "angle", "right", "up"].map((id) => input(id).valueAsNumber) as [number, number, number, number];
    if ([size, angle, right, up].every(Number.isFinite)) {
      this.send({ do: "place", offset: [right, up], size, rotate: (angle * Math.PI) / 180 });
    } else {
      this.placing(this.placement);
    }
  }

  surface({ area_m2 }: Surface): void {
    text("connection", `${area_m2.toFixed(area_m2 < 10 ? 2 : 1)} m² to paint`);
  }

  /** Nothing is known yet of the latest change. */
  wait(): void {
    document.body.classList.add("stale");
    text("quality", "estimating …");
  }

  estimate(estimate: Estimate, latest: boolean): void {
    document.body.classList.toggle("stale", !latest);
    const painted = estimate.paints.length > 0;
    const coarse = `estimate at ${(100 * estimate.texel_m).toFixed(1)} cm, refining …`;
    text("quality", !latest ? "estimating …" : !painted ? "" : estimate.own ? `at ${(100 * estimate.texel_m).toFixed(2)} cm` : coarse);
    text("flight", painted ? minutes(estimate.flight_time_s) : "–");
    text("mission", painted ? duration(estimate.mission_time_s) : "–");
    text("reach", percent(estimate.out_of_reach_share));
    text("gamut", estimate.out_of_gamut_share === null ? "–" : percent(estimate.out_of_gamut_share));
    const cell = (...content: (string | Node)[]) => {
      const cell = document.createElement("td");
      cell.append(...content);
      return cell;
    };
    const row = ({ name, srgb, litres: volume, flight_time_s }: Estimate["paints"][number]) => {
      const [row, swatch] = [document.createElement("tr"), document.createElement("i")];
      swatch.style.background = `rgb(${srgb.join(" ")})`;
      row.append(cell(swatch, name), cell(litres(volume)), cell((flight_time_s / 60).toFixed(1)));
      return row;
    };
    element("paints").replaceChildren(...estimate.paints.map(row));
    const note = (words: string) => Object.assign(document.createElement("li"), { textContent: words });
    element("notes").replaceChildren(...estimate.notes.map(note));
  }

  written(mission: string): void {
    text("written", `${mission} is written: paintcopter --mission ${mission}`);
  }

  /** What went wrong, for a while. */
  say(words: string): void {
    text("notice", words);
    document.body.classList.remove("stale");
    text("quality", "");
    clearTimeout(this.hide);
    this.hide = window.setTimeout(() => text("notice", ""), 12000);
  }
}
