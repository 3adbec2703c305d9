// Decoder of host-sim's messages (PROTOCOL.md) into arrays for drawing. It uses neither the document nor the network.

export interface BodyInfo {
  name: string;
  vertices: number;
  triangles: number;
  first_particle: number;
  particles: number;
}

export interface Parameter {
  key: string;
  label: string;
  unit: string;
  least: number;
  most: number;
  whole: boolean;
  logarithmic: boolean;
  choices: string[];
  meaning: string;
}

export interface SceneMessage {
  type: "scene";
  protocol: number;
  scene: number;
  name: string;
  text: string;
  scenes: string[];
  control: boolean;
  mode: "run" | "play";
  length: number;
  step: number;
  closes: boolean;
  force_scale: number;
  mask_radius: number; // m
  ground: number | null;
  version: string;
  bodies: BodyInfo[];
  tool: { vertices: number; triangles: number; radii: number[] };
  groups: number;
  links: number;
  parameters: Parameter[];
}

export interface Spread {
  p50: number;
  p99: number;
  max: number;
}

/** Where the device lets the grip move freely: an ellipsoid in the scene. */
export interface RegionInfo {
  centre: Triple; // m
  semi_axes: Triple; // m
  orientation: [number, number, number, number]; // w, x, y, z
  angle_rad: number;
}

export interface DeviceMessage {
  type: "device";
  connected: boolean;
  state: string;
  faults: string[];
  flags: string[];
  rate_hz: number;
  period_us: Spread & { edges: number[]; counts: number[] };
  missed: number;
  unanswered: number; // 0..1, share of the ticks without an answer from the board
  frame_age_ms: Spread;
  region: RegionInfo | null;
}

export interface RefusedMessage {
  type: "refused";
  command: string;
  why: string;
}

export interface RecordMessage {
  type: "record";
  steps: number;
  url: string;
}

export type TextMessage = SceneMessage | DeviceMessage | RefusedMessage | RecordMessage | { type: "bye" };

/**
 * Constant geometry. Triples and quadruples are stored one after another; quaternions are x, y, z, w, as in three.js.
 */
export interface Geometry {
  scene: number;
  triangles: Uint32Array[]; // one per body
  toolTriangles: Uint32Array;
  semiAxes: Float32Array; // m, 3 per particle
  ellipsoidAxes: Float32Array; // 4 per particle, particle_from_ellipsoid
  groups: { centre: number; members: Uint32Array }[];
  links: Uint32Array; // 2 per link
}

/** A surface that has moved. */
export interface Surface {
  positions: Float32Array; // m, 3 per vertex
  normals: Float32Array; // unit, 3 per vertex
}

export interface Particles {
  positions: Float32Array; // m, 3 a particle
  orientations: Float32Array; // 4 per particle: x, y, z, w
}

export interface Proxies {
  count: number;
  positions: Float32Array; // m
  goals: Float32Array; // m
  radii: Float32Array; // m
  touches: boolean[];
  sticks: boolean[];
}

export interface Plane {
  normal: [number, number, number];
  offset: number; // m, includes the proxy's radius
  velocity: number; // m/s
  proxy: number;
  touches: boolean;
}

/** A contact that presses on a body. */
export interface ContactForce {
  point: Triple; // m, of the surface
  force: number; // N
  body: number;
}

export type Triple = [number, number, number];
export type Quadruple = [number, number, number, number]; // x, y, z, w

export const handSources = ["script", "device", "mouse", "input", "still"] as const;

export interface Hand {
  tool: Triple; // m
  toolOrientation: Quadruple;
  hip: Triple; // m
  hipOrientation: Quadruple;
  force: Triple; // N, scene
  torque: Triple; // N*m, scene
  handForce: Triple; // N, device frame
  handTorque: Triple; // N*m, device frame
  curl: number;
  depth: number; // m
  speed: number; // simulated seconds per second
  buffered: number; // s
  source: (typeof handSources)[number];
  lateSteps: number;
  recordedSteps: number;
  viewers: number;
}

export interface Frame {
  kind: "frame";
  scene: number;
  time: number; // s
  step: number;
  inContact: boolean;
  overconstrained: boolean;
  paused: boolean;
  recording: boolean;
  diverged: boolean;
  surfaces: Map<number, Surface>; // bodies that have moved
  toolSurface: Surface | null; // null: it has not moved
  particles: Map<number, Particles>;
  proxies: Proxies | null;
  planes: Plane[] | null; // null: not subscribed
  contacts: ContactForce[];
  hand: Hand | null;
  parameters: Float32Array | null;
}

/** Columns of a sample, after its time. */
export const sampleColumns = [
  "force",
  "torque",
  "depth",
  "total",
  "ccd",
  "popout",
  "proxy",
  "tool",
  "collide",
  "deform",
  "skin",
] as const;

export interface Samples {
  kind: "samples";
  scene: number;
  count: number;
  dropped: number;
  times: Float64Array; // s
  values: Float32Array; // sampleColumns.length per step
}

const numbersOfHand = 34;

/** Sequential reader of a binary message. */
class Reader {
  private readonly view: DataView;
  private at = 0;

  constructor(private readonly buffer: ArrayBuffer) {
    this.view = new DataView(buffer);
  }

  get offset(): number {
    return this.at;
  }
  u32(): number {
    this.at += 4;
    return this.view.getUint32(this.at - 4, true);
  }
  f64(): number {
    this.at += 8;
    return this.view.getFloat64(this.at - 8, true);
  }
  // Typed arrays use the machine's byte order: little-endian, like the messages. Each part is aligned to 4 bytes.
  u32s(count: number): Uint32Array {
    this.at += 4 * count;
    return new Uint32Array(this.buffer, this.at - 4 * count, count);
  }
  f32s(count: number): Float32Array {
    this.at += 4 * count;
    return new Float32Array(this.buffer, this.at - 4 * count, count);
  }
  skipTo(offset: number): void {
    this.at = offset;
  }
}

/** A copy of quaternions, reordered from (w, x, y, z) to (x, y, z, w). */
function reordered(quaternions: Float32Array): Float32Array {
  const result = new Float32Array(quaternions.length);
  for (let i = 0; i < quaternions.length; i += 4) {
    result[i] = quaternions[i + 1]!;
    result[i + 1] = quaternions[i + 2]!;
    result[i + 2] = quaternions[i + 3]!;
    result[i + 3] = quaternions[i]!;
  }
  return result;
}

export function readGeometry(buffer: ArrayBuffer, scene: SceneMessage): Geometry {
  const reader = new Reader(buffer);
  reader.u32();
  const id = reader.u32();
  const triangles = scene.bodies.map((body) => reader.u32s(3 * body.triangles));
  const toolTriangles = reader.u32s(3 * scene.tool.triangles);
  const particles = scene.bodies.reduce((sum, body) => sum + body.particles, 0);
  const semiAxes = reader.f32s(3 * particles);
  const ellipsoidAxes = reordered(reader.f32s(4 * particles));
  const groups = Array.from({ length: scene.groups }, () => {
    const centre = reader.u32();
    return { centre, members: reader.u32s(reader.u32()) };
  });
  return { scene: id, triangles, toolTriangles, semiAxes, ellipsoidAxes, groups, links: reader.u32s(2 * scene.links) };
}

/** Decodes an octahedral normal, u and v in [-1, 1] (Cigolle et al. 2014), into `out` at `at`. */
export function unfoldNormal(u: number, v: number, out: Float32Array, at: number): void {
  const z = 1 - Math.abs(u) - Math.abs(v);
  const x = z >= 0 ? u : (1 - Math.abs(v)) * (u < 0 ? -1 : 1);
  const y = z >= 0 ? v : (1 - Math.abs(u)) * (v < 0 ? -1 : 1);
  const length = Math.hypot(x, y, z);
  out[at] = x / length;
  out[at + 1] = y / length;
  out[at + 2] = z / length;
}

function readSurface(buffer: ArrayBuffer, offset: number, count: number): Surface {
  const box = new Float32Array(buffer, offset, 6);
  const view = new DataView(buffer, offset + 24);
  const positions = new Float32Array(3 * count);
  const normals = new Float32Array(3 * count);
  for (let i = 0; i < count; ++i) {
    for (let k = 0; k < 3; ++k) {
      positions[3 * i + k] = box[k]! + (box[3 + k]! * view.getUint16(8 * i + 2 * k, true)) / 65535;
    }
    unfoldNormal(view.getInt8(8 * i + 6) / 127, view.getInt8(8 * i + 7) / 127, normals, 3 * i);
  }
  return { positions, normals };
}

function readParticles(buffer: ArrayBuffer, offset: number, count: number): Particles {
  const view = new DataView(buffer, offset);
  const positions = new Float32Array(3 * count);
  const orientations = new Float32Array(4 * count);
  for (let i = 0; i < count; ++i) {
    for (let k = 0; k < 3; ++k) {
      positions[3 * i + k] = view.getFloat32(20 * i + 4 * k, true);
    }
    for (let k = 0; k < 4; ++k) {
      orientations[4 * i + ((k + 3) % 4)] = view.getInt16(20 * i + 12 + 2 * k, true) / 32767;
    }
  }
  return { positions, orientations };
}

function readProxies(buffer: ArrayBuffer, offset: number, count: number): Proxies {
  const view = new DataView(buffer, offset);
  const result: Proxies = {
    count,
    positions: new Float32Array(3 * count),
    goals: new Float32Array(3 * count),
    radii: new Float32Array(count),
    touches: [],
    sticks: [],
  };
  for (let i = 0; i < count; ++i) {
    for (let k = 0; k < 3; ++k) {
      result.positions[3 * i + k] = view.getFloat32(32 * i + 4 * k, true);
      result.goals[3 * i + k] = view.getFloat32(32 * i + 12 + 4 * k, true);
    }
    const flags = view.getUint32(32 * i + 24, true);
    result.touches.push((flags & 1) !== 0);
    result.sticks.push((flags & 2) !== 0);
    result.radii[i] = view.getFloat32(32 * i + 28, true);
  }
  return result;
}

function readPlanes(buffer: ArrayBuffer, offset: number, count: number): Plane[] {
  const view = new DataView(buffer, offset);
  return Array.from({ length: count }, (_, i) => {
    const f32 = (k: number): number => view.getFloat32(28 * i + 4 * k, true);
    return {
      normal: [f32(0), f32(1), f32(2)],
      offset: f32(3),
      velocity: f32(4),
      proxy: view.getUint32(28 * i + 20, true),
      touches: (view.getUint32(28 * i + 24, true) & 1) !== 0,
    };
  });
}

function readContacts(buffer: ArrayBuffer, offset: number, count: number): ContactForce[] {
  const view = new DataView(buffer, offset);
  return Array.from({ length: count }, (_, i) => {
    const f32 = (k: number): number => view.getFloat32(20 * i + 4 * k, true);
    return { point: [f32(0), f32(1), f32(2)], force: f32(3), body: view.getUint32(20 * i + 16, true) };
  });
}

function readHand(numbers: Float32Array): Hand {
  const triple = (at: number): Triple => [numbers[at]!, numbers[at + 1]!, numbers[at + 2]!];
  const quadruple = (at: number): Quadruple => [numbers[at + 1]!, numbers[at + 2]!, numbers[at + 3]!, numbers[at]!];
  return {
    tool: triple(0),
    toolOrientation: quadruple(3),
    hip: triple(7),
    hipOrientation: quadruple(10),
    force: triple(14),
    torque: triple(17),
    handForce: triple(20),
    handTorque: triple(23),
    curl: numbers[26]!,
    depth: numbers[27]!,
    speed: numbers[28]!,
    buffered: numbers[29]!,
    source: handSources[numbers[30]!] ?? "still",
    lateSteps: numbers[31]!,
    recordedSteps: numbers[32]!,
    viewers: numbers[33]!,
  };
}

export function readFrame(buffer: ArrayBuffer): Frame {
  const reader = new Reader(buffer);
  reader.u32();
  const scene = reader.u32();
  const time = reader.f64();
  const step = reader.f64();
  const flags = reader.u32();
  const frame: Frame = {
    kind: "frame",
    scene,
    time,
    step,
    inContact: (flags & 1) !== 0,
    overconstrained: (flags & 2) !== 0,
    paused: (flags & 4) !== 0,
    recording: (flags & 8) !== 0,
    diverged: (flags & 16) !== 0,
    surfaces: new Map(),
    toolSurface: null,
    particles: new Map(),
    proxies: null,
    planes: null,
    contacts: [],
    hand: null,
    parameters: null,
  };
  // Each part starts with kind, index, count and size; unknown kinds are skipped.
  for (let parts = reader.u32(); parts > 0; --parts) {
    const kind = reader.u32();
    const index = reader.u32();
    const count = reader.u32();
    const bytes = reader.u32();
    const offset = reader.offset;
    switch (kind) {
      case 1:
        frame.surfaces.set(index, readSurface(buffer, offset, count));
        break;
      case 2:
        frame.toolSurface = readSurface(buffer, offset, count);
        break;
      case 3:
        frame.particles.set(index, readParticles(buffer, offset, count));
        break;
      case 4:
        frame.proxies = readProxies(buffer, offset, count);
        break;
      case 5:
        frame.planes = readPlanes(buffer, offset, count);
        break;
      case 6:
        frame.hand = readHand(new Float32Array(buffer, offset, numbersOfHand));
        break;
      case 7:
        frame.parameters = new Float32Array(buffer, offset, count);
        break;
      case 8:
        frame.contacts = readContacts(buffer, offset, count);
        break;
      default: // of a later host-sim
    }
    reader.skipTo(offset + bytes);
  }
  return frame;
}

export function readSamples(buffer: ArrayBuffer): Samples {
  const reader = new Reader(buffer);
  reader.u32();
  const scene = reader.u32();
  const first = reader.f64();
  const count = reader.u32();
  const dropped = reader.u32();
  const rows = reader.f32s(12 * count);
  const times = new Float64Array(count);
  const values = new Float32Array(sampleColumns.length * count);
  for (let i = 0; i < count; ++i) {
    times[i] = first + rows[12 * i]!;
    values.set(rows.subarray(12 * i + 1, 12 * i + 12), sampleColumns.length * i);
  }
  return { kind: "samples", scene, count, dropped, times, values };
}

/** The kind of a binary message: 1 geometry, 2 frame, 3 samples. */
export function kindOf(buffer: ArrayBuffer): number {
  return new DataView(buffer).getUint32(0, true);
}
