// Messages assembled byte by byte according to PROTOCOL.md are decoded correctly.
import assert from "node:assert/strict";
import { test } from "node:test";

import {
  kindOf,
  readFrame,
  readGeometry,
  readSamples,
  sampleColumns,
  type SceneMessage,
  unfoldNormal,
} from "../../../../host-sim/page/src/protocol.ts";

type Kind = "u32" | "f32" | "f64" | "u16" | "i16" | "i8";
const sizes: Record<Kind, number> = {
  u32: 4,
  f32: 4,
  f64: 8,
  u16: 2,
  i16: 2,
  i8: 1,
};

/** Little-endian numbers, one after another. */
function bytes(...numbers: [Kind, ...number[]][]): ArrayBuffer {
  const buffer = new ArrayBuffer(numbers.reduce((sum, [kind, ...values]) => sum + sizes[kind] * values.length, 0));
  const view = new DataView(buffer);
  let at = 0;
  for (const [kind, ...values] of numbers) {
    for (const value of values) {
      switch (kind) {
        case "u32":
          view.setUint32(at, value, true);
          break;
        case "f32":
          view.setFloat32(at, value, true);
          break;
        case "f64":
          view.setFloat64(at, value, true);
          break;
        case "u16":
          view.setUint16(at, value, true);
          break;
        case "i16":
          view.setInt16(at, value, true);
          break;
        case "i8":
          view.setInt8(at, value);
      }
      at += sizes[kind];
    }
  }
  return buffer;
}

function close(actual: ArrayLike<number>, expected: number[], tolerance: number): void {
  assert.equal(actual.length, expected.length);
  expected.forEach((value, i) =>
    assert.ok(Math.abs(actual[i]! - value) <= tolerance, `${i}: ${actual[i]}, not ${value}`),
  );
}

const scene: SceneMessage = {
  type: "scene",
  protocol: 1,
  scene: 7,
  name: "two",
  text: "",
  scenes: [],
  control: true,
  mode: "run",
  length: 0,
  step: 0.01,
  closes: false,
  force_scale: 1,
  mask_radius: 0,
  ground: null,
  version: "0",
  bodies: [
    { name: "a", vertices: 3, triangles: 1, first_particle: 0, particles: 1 },
    { name: "b", vertices: 4, triangles: 2, first_particle: 1, particles: 1 },
  ],
  tool: { vertices: 3, triangles: 1, radii: [0.01] },
  groups: 2,
  links: 1,
  parameters: [],
};

test("geometry: every body, the tool, ellipsoids, groups and links in their order", () => {
  const buffer = bytes(
    ["u32", 1, 7],
    ["u32", 0, 1, 2],
    ["u32", 0, 1, 2, 2, 1, 3],
    ["u32", 2, 1, 0],
    ["f32", 1, 2, 3, 4, 5, 6],
    ["f32", 1, 0, 0, 0, 0.5, -0.5, 0.25, 0.75], // w, x, y, z
    ["u32", 0, 2, 0, 1, 1, 1, 1],
    ["u32", 0, 1],
  );
  assert.equal(kindOf(buffer), 1);
  const geometry = readGeometry(buffer, scene);
  assert.equal(geometry.scene, 7);
  assert.deepEqual(geometry.triangles.map((one) => [...one]), [[0, 1, 2], [0, 1, 2, 2, 1, 3]]); // prettier-ignore
  assert.deepEqual([...geometry.toolTriangles], [2, 1, 0]);
  assert.deepEqual([...geometry.semiAxes], [1, 2, 3, 4, 5, 6]);
  assert.deepEqual([...geometry.ellipsoidAxes], [0, 0, 0, 1, -0.5, 0.25, 0.75, 0.5]); // x, y, z, w
  assert.deepEqual(
    geometry.groups.map(({ centre, members }) => [centre, [...members]]),
    [
      [0, [0, 1]],
      [1, [1]],
    ],
  );
  assert.deepEqual([...geometry.links], [0, 1]);
});

test("a frame without parts has its time, its step and each flag", () => {
  const flags = ["inContact", "overconstrained", "paused", "recording", "diverged"] as const;
  flags.forEach((flag, bit) => {
    const frame = readFrame(bytes(["u32", 2, 7], ["f64", 1.25, 2 ** 40], ["u32", 1 << bit, 0]));
    assert.equal(frame.scene, 7);
    assert.equal(frame.time, 1.25);
    assert.equal(frame.step, 2 ** 40);
    assert.deepEqual(
      flags.filter((other) => frame[other]),
      [flag],
    );
    assert.equal(frame.surfaces.size, 0);
    assert.equal(frame.hand, null);
    assert.equal(frame.planes, null);
  });
});

const head: [Kind, ...number[]][] = [
  ["u32", 2, 7],
  ["f64", 0, 0],
];

test("a surface fills its box, from the first to the last of 65536 places, and normals are unfolded", () => {
  const frame = readFrame(
    bytes(
      ...head,
      ["u32", 0, 1],
      ["u32", 1, 1, 2, 24 + 2 * 8],
      ["f32", -1, 0, 2],
      ["f32", 2, 1, 0.5],
      ["u16", 0, 65535, 0],
      ["i8", 127, 0],
      ["u16", 65535, 0, 65535],
      ["i8", 0, 0],
    ),
  );
  const surface = frame.surfaces.get(1)!;
  close(surface.positions, [-1, 1, 2, 1, 0, 2.5], 1e-6);
  close(surface.normals, [1, 0, 0, 0, 0, 1], 1e-6);
  assert.equal(frame.toolSurface, null);
});

test("unknown parts are skipped", () => {
  const frame = readFrame(
    bytes(
      ...head,
      ["u32", 0, 3],
      ["u32", 99, 0, 3, 12, 1, 2, 3],
      ["u32", 7, 0, 2, 8],
      ["f32", 20, 0.5],
      ["u32", 8, 0, 1, 20],
      ["f32", 1, 2, 3, 0.5],
      ["u32", 1],
    ),
  );
  assert.deepEqual([...frame.parameters!], [20, 0.5]);
  assert.deepEqual(frame.contacts, [{ point: [1, 2, 3], force: 0.5, body: 1 }]);
});

test("particles, proxies and planes", () => {
  const frame = readFrame(
    bytes(
      ...head,
      ["u32", 0, 3],
      ["u32", 3, 1, 1, 20],
      ["f32", 1, 2, 3],
      ["i16", 0, 32767, 0, -32767], // w, x, y, z
      ["u32", 4, 0, 2, 64],
      ["f32", 1, 2, 3, 4, 5, 6],
      ["u32", 1],
      ["f32", 0.5],
      ["f32", 7, 8, 9, 10, 11, 12],
      ["u32", 2],
      ["f32", 0.25],
      ["u32", 5, 0, 1, 28],
      ["f32", 0, 1, 0, -0.5, 2],
      ["u32", 3, 1],
    ),
  );
  const particles = frame.particles.get(1)!;
  assert.deepEqual([...particles.positions], [1, 2, 3]);
  assert.deepEqual([...particles.orientations], [1, 0, -1, 0]);
  const proxies = frame.proxies!;
  assert.deepEqual([...proxies.positions], [1, 2, 3, 7, 8, 9]);
  assert.deepEqual([...proxies.goals], [4, 5, 6, 10, 11, 12]);
  assert.deepEqual([...proxies.radii], [0.5, 0.25]);
  assert.deepEqual(proxies.touches, [true, false]);
  assert.deepEqual(proxies.sticks, [false, true]);
  assert.deepEqual(frame.planes, [{ normal: [0, 1, 0], offset: -0.5, velocity: 2, proxy: 3, touches: true }]);
});

test("each of the hand's 34 numbers is in its place", () => {
  const numbers = Array.from({ length: 34 }, (_, i) => i);
  numbers[30] = 2;
  const frame = readFrame(bytes(...head, ["u32", 0, 1], ["u32", 6, 0, 1, 4 * 34], ["f32", ...numbers]));
  assert.deepEqual(frame.hand, {
    tool: [0, 1, 2],
    toolOrientation: [4, 5, 6, 3],
    hip: [7, 8, 9],
    hipOrientation: [11, 12, 13, 10],
    force: [14, 15, 16],
    torque: [17, 18, 19],
    handForce: [20, 21, 22],
    handTorque: [23, 24, 25],
    curl: 26,
    depth: 27,
    speed: 28,
    buffered: 29,
    source: "mouse",
    lateSteps: 31,
    recordedSteps: 32,
    viewers: 33,
  });
});

test("samples: times count from the first, and each column is its own", () => {
  const row = (from: number): number[] => Array.from({ length: 12 }, (_, i) => from + i);
  const buffer = bytes(["u32", 3, 7], ["f64", 100], ["u32", 2, 5], ["f32", ...row(0), ...row(0.5)]);
  assert.equal(kindOf(buffer), 3);
  const samples = readSamples(buffer);
  assert.equal(samples.scene, 7);
  assert.equal(samples.count, 2);
  assert.equal(samples.dropped, 5);
  assert.deepEqual([...samples.times], [100, 100.5]);
  assert.equal(sampleColumns.length, 11);
  assert.deepEqual([...samples.values], [...row(0).slice(1), ...row(0.5).slice(1)]);
});

test("octahedral normals, folded as Cigolle et al. have it, come back within half a step of their 8 bits", () => {
  const directions = [-1, -0.3, 0, 0.2, 1];
  const sign = (x: number): number => (x < 0 ? -1 : 1);
  for (const x of directions) {
    for (const y of directions) {
      for (const z of directions.filter((one) => one !== 0)) {
        const size = Math.abs(x) + Math.abs(y) + Math.abs(z);
        const [u, v] = [x / size, y / size];
        const folded = z >= 0 ? [u, v] : [(1 - Math.abs(v)) * sign(u), (1 - Math.abs(u)) * sign(v)];
        const out = new Float32Array(3);
        unfoldNormal(Math.round(127 * folded[0]!) / 127, Math.round(127 * folded[1]!) / 127, out, 0);
        const length = Math.hypot(x, y, z);
        // Half a step is 1/254 in u and v; decoding and normalisation magnify it at most threefold.
        close(out, [x / length, y / length, z / length], 3 / 254);
      }
    }
  }
});
