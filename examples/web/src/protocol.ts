// What page and server say to each other; see examples/src/vr/protocol.rs.

export const PROTOCOL = 3;
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
  | { do: "live" | "pause"; on: boolean }
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
  paused: boolean;
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
  paused: boolean;
}

export type Notice =
  | { type: "feedback"; say: string; distance?: number; lag?: number }
  | { type: "text"; text: string }
  | { type: "saved"; path: string; left_out: number }
  | { type: "ended"; folder: string; left_out: number; failed: string | null };

export type Quadruple = [number, number, number, number];

/** The first message where a run or a recording is watched. */
export interface Watching {
  type: "watching";
  protocol: number;
  key: string;
  next_sequence: number;
  name: string;
  paused: boolean;
}

export interface Place {
  type: "place";
  position: Triple;
  rotation: Quadruple;
  cradle: Triple;
  heading: number;
}

export interface Frame {
  name: string;
  position: Triple;
  rotation: Quadruple;
}

export type ServerMessage =
  | Welcome
  | Watching
  | Place
  | { type: "frames"; frames: Frame[] }
  | { type: "playback"; elapsed: number | null; paused: boolean }
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

export interface EntityPart {
  /** Points in pairs, not corners of triangles. */
  lines: boolean;
  thickness: number;
  pixels: boolean;
  vertices: number;
  corners: number;
  positions: Float32Array;
  colours: Uint8Array;
  indices: Uint32Array;
}

export interface Entity {
  key: string;
  frame: string;
  parts: EntityPart[];
}

export interface Picture {
  frame: string;
  format: string;
  data: Uint8Array<ArrayBuffer>;
}

function readHead(data: ArrayBuffer): [unknown, number] {
  const end = 8 + new DataView(data).getUint32(4, true);
  return [JSON.parse(new TextDecoder().decode(new Uint8Array(data, 8, end - 8))), end];
}

export function readEntity(data: ArrayBuffer): Entity {
  const [head, end] = readHead(data) as [Entity, number];
  let at = end;
  for (const part of head.parts) {
    part.positions = new Float32Array(data, at, 3 * part.vertices);
    part.colours = new Uint8Array(data, at + 12 * part.vertices, 4 * part.vertices);
    part.indices = new Uint32Array(data, at + 16 * part.vertices, part.corners);
    at += 16 * part.vertices + 4 * part.corners;
  }
  return head;
}

export function readPicture(data: ArrayBuffer): Picture {
  const [head, end] = readHead(data) as [{ frame: string; format: string }, number];
  return { ...head, data: new Uint8Array(data, end) };
}
