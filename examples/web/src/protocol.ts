// What page and server say to each other; see examples/src/vr/protocol.rs.

export const PROTOCOL = 1;
export const STATE_VERSION = 1;

export type Mode = "idle" | "painting" | "viewing";
export type Triple = [number, number, number];

export interface State {
  version: number;
  sequence: number;
  time: number;
  mode: Mode;
  nozzle: { translation: Triple; rotation: [number, number, number, number] };
  cradle: { position: Triple; heading: number };
  colour: number;
  flow: number;
}

export type Command =
  | { do: "live"; on: boolean }
  | { do: "undo" | "fly" | "save" | "end" }
  | { do: "erase"; point: Triple; radius: number };

export type Event = { state: State } | { command: { sequence: number; command: Command } };

export interface Welcome {
  type: "welcome";
  protocol: number;
  key: string;
  next_sequence: number;
  clock: number;
  name: string;
  atlas: [number, number];
  palette: { name: string; srgb: Triple }[];
  live: boolean;
  cradle: Triple;
  heading: number;
  far: number;
  stand_off: [number, number];
}

export interface RobotState {
  type: "robot";
  position: Triple;
  rotation: [number, number, number, number];
  pan_tilt: [number, number];
  nozzle: Triple;
  aim: Triple;
  spraying: boolean;
  lag: number;
  latency: number;
  waiting: boolean;
  live: boolean;
}

export type Notice =
  | { type: "feedback"; say: string; distance?: number; lag?: number }
  | { type: "text"; text: string }
  | { type: "ended"; folder: string };

export type ServerMessage =
  | Welcome
  | RobotState
  | { type: "ack"; next_sequence: number }
  | { type: "notice"; notice: Notice };

export interface Patch {
  picture: number;
  left: number;
  top: number;
  width: number;
  height: number;
  rgb: Uint8Array;
}

export interface Surface {
  positions: Float32Array;
  uv: Float32Array;
  faces: Uint32Array;
}

export function readPatch(data: ArrayBuffer): Patch {
  const view = new DataView(data);
  const side = (k: number) => view.getUint16(4 + 2 * k, true);
  return {
    picture: view.getUint8(1),
    left: side(0),
    top: side(1),
    width: side(2),
    height: side(3),
    rgb: new Uint8Array(data, 12),
  };
}

export function readSurface(data: ArrayBuffer): Surface {
  const view = new DataView(data);
  const vertices = view.getUint32(4, true);
  const faces = view.getUint32(8, true);
  const uv = 12 + 12 * vertices;
  return {
    positions: new Float32Array(data, 12, 3 * vertices),
    uv: new Float32Array(data, uv, 2 * vertices),
    faces: new Uint32Array(data, uv + 8 * vertices, 3 * faces),
  };
}
