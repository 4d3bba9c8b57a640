// The panel: palette, sliders, buttons, read-outs.
import type { RobotState, Triple, Welcome } from "./protocol";

// Flow of the open valve, m^3/s.
const MOST_FLOW = 5e-7;

const element = <T extends HTMLElement>(id: string) => document.getElementById(id) as T;

export class Tools {
  colour = 0;
  erasing = false;
  private paints: Triple[] = [];
  private standOff: [number, number] = [0.06, 0.14];
  private far = 0;
  private waiting = false;

  /** Calls `act` with the name of a button that is pressed. */
  constructor(act: (name: string, on: boolean) => void) {
    for (const name of ["record", "pause", "live", "fly", "undo", "erase", "flown", "hands", "save", "end", "enter"]) {
      const button = element<HTMLButtonElement>(name);
      button.addEventListener("click", () => {
        const toggles = button.hasAttribute("aria-pressed");
        const on = toggles && button.getAttribute("aria-pressed") !== "true";
        if (toggles) button.setAttribute("aria-pressed", String(on));
        if (name === "erase") this.erasing = on;
        // The next key is meant for the scene.
        button.blur();
        act(name, on);
      });
    }
  }

  welcome(welcome: Welcome): void {
    this.standOff = welcome.stand_off;
    this.far = welcome.far;
    this.paints = welcome.palette.map((paint) => paint.srgb);
    element("live").setAttribute("aria-pressed", String(welcome.live));
    this.paused(welcome.paused);
    const palette = element("palette");
    palette.replaceChildren(
      ...welcome.palette.map((paint, number) => {
        const button = document.createElement("button");
        button.style.background = `rgb(${paint.srgb.join(",")})`;
        button.title = paint.name;
        button.setAttribute("role", "radio");
        button.setAttribute("aria-label", paint.name);
        button.setAttribute("aria-checked", String(number === this.colour));
        button.addEventListener("click", () => {
          this.colour = number;
          for (const [k, other] of [...palette.children].entries()) other.setAttribute("aria-checked", String(k === number));
        });
        return button;
      }),
    );
  }

  /** Colour of a thick coat of the paint, sRGB. */
  get paint(): Triple {
    return this.paints[this.colour] ?? [0, 0, 0];
  }

  /** Flow, m^3/s. */
  get flow(): number {
    return MOST_FLOW * element<HTMLInputElement>("flow").valueAsNumber;
  }

  /** Distance of the gun from the surface, metres: what the brush size stands for. */
  get distance(): number {
    const [near, far] = this.standOff;
    return near + (far - near) * element<HTMLInputElement>("brush").valueAsNumber;
  }

  /** Distance that a gun at `distance` paints from, metres; `null` where it paints nothing now. */
  paintsFrom(distance: number): number | null {
    if (this.isPaused || this.waiting || distance >= this.far) return null;
    return Math.min(this.standOff[1], Math.max(this.standOff[0], distance));
  }

  /** Shows what a session or a recording does, and hides what it cannot do. */
  watching(on: boolean): void {
    document.body.classList.toggle("watching", on);
    element("pause").title = on ? "Hold the picture; a recording stops (P)" : "Leave out what your hand does (P)";
  }

  get isPaused(): boolean {
    return element("pause").getAttribute("aria-pressed") === "true";
  }

  paused(on: boolean): void {
    element("pause").setAttribute("aria-pressed", String(on));
    element("record").setAttribute("aria-pressed", String(!on));
  }

  playback(elapsed: number | null): void {
    element("played").textContent = elapsed === null ? "live" : `${elapsed.toFixed(1)} s`;
  }

  connected(open: boolean, waiting: number): void {
    element("dot").classList.toggle("on", open);
    element("connection").textContent = open ? "connected" : `connection lost, ${waiting} states kept`;
  }

  /** There is no connection, and why. */
  status(text: string): void {
    element("dot").classList.remove("on");
    element("connection").textContent = text;
  }

  robot(state: RobotState): void {
    this.paused(state.paused);
    this.waiting = state.waiting;
    element("lag").textContent = `${state.lag.toFixed(2)} m`;
    element("latency").textContent = state.latency > 0 ? `${state.latency.toFixed(1)} s` : "–";
  }

  hands(swapped: boolean): void {
    element("hands").textContent = swapped ? "paint: trigger" : "paint: touchpad";
  }

  headset(available: boolean): void {
    element("enter").hidden = !available;
    element("hands").hidden = !available;
  }
}
