// Pressure of contacts on a surface, and its colours.
import assert from "node:assert/strict";
import { test } from "node:test";

import { addPressure, pressureAt, PressureScale } from "../../../../host-sim/page/src/pressure.ts";

test("the pressure over the disc adds up to the force", () => {
  const [force, radius, rings] = [2.5, 0.03, 2000];
  let sum = 0;
  for (let k = 0; k < rings; ++k) {
    const at = ((k + 0.5) * radius) / rings;
    sum += pressureAt(force, radius, at * at) * 2 * Math.PI * at * (radius / rings);
  }
  assert.ok(Math.abs(sum / force - 1) < 1e-5, `${sum} N`);
  assert.equal(pressureAt(force, radius, 1.01 * radius * radius), 0);
});

test("contacts add, each to the vertices that it reaches", () => {
  const pressure = new Float32Array(3);
  const contact = {
    point: [0, 0, 0] as [number, number, number],
    force: 1,
    body: 0,
  };
  const max = addPressure(new Float32Array([0, 0, 0, 0.5, 0, 0, 2, 0, 0]), [contact, contact], 1, pressure);
  const top = 6 / Math.PI;
  assert.ok(Math.abs(pressure[0]! - top) < 1e-6);
  assert.ok(Math.abs(pressure[1]! - top * 0.75 ** 2) < 1e-6);
  assert.equal(pressure[2], 0);
  assert.ok(Math.abs(max - top) < 1e-6);
});

test("the scale ends at a round pressure, no less than the largest", () => {
  for (const [max, top] of [
    [130, 200],
    [0.9, 1],
    [5000, 5000],
    [5001, 10000],
  ] as const) {
    const scale = new PressureScale();
    scale.include(max);
    assert.ok(Math.abs(scale.top / top - 1) < 1e-9, `${scale.top} for ${max}`);
  }
});
