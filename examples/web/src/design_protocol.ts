// What the page of a design and the program say to each other; see examples/src/vr/design/message.rs.

export const PROTOCOL = 1;

type Pair = [number, number];
type Triple = [number, number, number];

export type Part = { kind: "pick"; point: Triple } | { kind: "disc"; point: Triple; normal: Triple; radius: number };

export type Change =
  | { do: "place"; offset: Pair; size: number; rotate: number }
  | { do: "palette"; name: string }
  | { do: "wall"; name: string | null }
  | { do: "region" | "keep_clean"; surface: number; part: Part }
  | { do: "whole_surface" | "undo_clean" | "write" | "end" };

export interface Placement {
  /** Right of and above the middle of the surface, and width, metres; counter-clockwise, radians. */
  offset: Pair;
  size: number;
  rotate: number;
}

export interface State {
  type: "state";
  number: number;
  picture: (Placement & { name: string; aspect: number }) | null;
  palette: string;
  wall: string | null;
  region: string | null;
  keep_clean: string[];
}

export interface Hello {
  type: "hello";
  protocol: number;
  key: string;
  name: string;
  folder: string;
  palettes: string[];
  walls: string[];
}

export type Reply =
  | Hello
  | State
  | { type: "error"; text: string }
  | { type: "written"; mission: string }
  | { type: "ended"; folder: string };

export interface Surface {
  surface: number;
  vertices: Pair;
  faces: Pair;
  extent: Pair;
  area_m2: number;
  positions: Float32Array;
  /** Metres from the lower left corner of the texels. */
  uv: Float32Array;
  corners: Uint32Array;
  restPositions: Float32Array;
  restCorners: Uint32Array;
  /** Metres to the right of and above the middle of the plane that pictures lie on. */
  places: Float32Array;
}

export interface Estimate {
  number: number;
  surface: number;
  texels: Pair;
  texel_m: number;
  own: boolean;
  paints: { name: string; srgb: Triple; litres: number; flight_time_s: number }[];
  flight_time_s: number;
  mission_time_s: number;
  out_of_reach_share: number;
  out_of_gamut_share: number | null;
  notes: string[];
  rgba: Uint8Array<ArrayBuffer>;
}

export const [SURFACE, ESTIMATE, PICTURE] = [1, 2, 3];

/** Head and where the rest begins. */
function readHead(data: ArrayBuffer): [unknown, number] {
  const end = 8 + new DataView(data).getUint32(4, true);
  return [JSON.parse(new TextDecoder().decode(new Uint8Array(data, 8, end - 8))), end];
}

export function readSurface(data: ArrayBuffer): Surface {
  const [head, end] = readHead(data);
  const surface = head as Surface;
  let at = end;
  const floats = (count: number) => new Float32Array(data, at, count).subarray(((at += 4 * count), 0));
  const words = (count: number) => new Uint32Array(data, at, count).subarray(((at += 4 * count), 0));
  const [vertices, rest] = surface.vertices;
  surface.positions = floats(3 * vertices);
  surface.uv = floats(2 * vertices);
  surface.corners = words(3 * surface.faces[0]);
  surface.restPositions = floats(3 * rest);
  surface.restCorners = words(3 * surface.faces[1]);
  surface.places = floats(2 * vertices);
  return surface;
}

export function readEstimate(data: ArrayBuffer): Estimate {
  const [head, end] = readHead(data);
  return { ...(head as Estimate), rgba: new Uint8Array(data, end) };
}

export const readPicture = (data: ArrayBuffer): Uint8Array<ArrayBuffer> => new Uint8Array(data, readHead(data)[1]);

/** A picture as the program takes it. */
export function pictureMessage(number: number, name: string, file: ArrayBuffer): Blob {
  const head = new TextEncoder().encode(JSON.stringify({ number, name }));
  const length = new DataView(new ArrayBuffer(4));
  length.setUint32(0, head.length, true);
  return new Blob([length.buffer, head, file]);
}
