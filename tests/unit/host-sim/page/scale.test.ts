// Sliders reach every value of their range, and numbers are written as they are read.
import assert from "node:assert/strict";
import { test } from "node:test";

import {
  placeOf,
  rounded,
  type Scale,
  steady,
  valueAt,
  withUnit,
  written,
} from "../../../../host-sim/page/src/scale.ts";

const linear: Scale = { least: -1, most: 3, whole: false, logarithmic: false };
const logarithmic: Scale = { least: 0.1, most: 1000, whole: false, logarithmic: true };
const fromZero: Scale = { least: 0, most: 200, whole: false, logarithmic: true };
const whole: Scale = { least: 0, most: 50, whole: true, logarithmic: false };

test("both ends of a slider are the ends of the range, exactly", () => {
  const odd: Scale = { least: 0.012345678, most: 9.87654321, whole: false, logarithmic: true };
  for (const scale of [linear, logarithmic, fromZero, whole, odd]) {
    assert.equal(valueAt(scale, 0), scale.least);
    assert.equal(valueAt(scale, 1), scale.most);
    assert.equal(placeOf(scale, scale.least), 0);
    assert.equal(placeOf(scale, scale.most), 1);
  }
});

test("the middle of a slider is the mean, or the geometric mean", () => {
  assert.equal(valueAt(linear, 0.5), 1);
  assert.equal(valueAt(logarithmic, 0.5), 10);
  assert.equal(valueAt(whole, 0.5), 25);
});

test("there and back lies within the three digits that are kept", () => {
  for (const scale of [linear, logarithmic, fromZero]) {
    for (let place = 0.01; place < 1; place += 0.01) {
      const value = valueAt(scale, place);
      const again = valueAt(scale, placeOf(scale, value));
      assert.ok(Math.abs(again - value) <= 0.01 * Math.abs(value), `${value} became ${again}`);
    }
  }
});

test("a slider only rises", () => {
  for (const scale of [linear, logarithmic, fromZero, whole]) {
    for (let i = 1; i <= 1000; ++i) {
      assert.ok(valueAt(scale, i / 1000) >= valueAt(scale, (i - 1) / 1000));
    }
  }
});

test("values outside the range stand at its ends, and a range of one value is no reason to fail", () => {
  assert.equal(placeOf(linear, 99), 1);
  assert.equal(placeOf(logarithmic, 0), 0);
  assert.equal(placeOf({ ...linear, most: -1 }, 5), 0);
  assert.equal(rounded(whole, 50.4), 50);
  assert.equal(rounded({ ...linear, most: 2.99999 }, 2.99999), 2.99999);
});

test("numbers are written without noise", () => {
  assert.equal(written(0.1 + 0.2), "0.3");
  assert.equal(written(0.029999999329447746), "0.03"); // 0.03 as a float of 32 bits
  assert.equal(written(1e-7), "1e-7");
  assert.equal(written(0), "0");
  assert.equal(written(NaN), "–");
  assert.equal(withUnit(12.3456, "N/m"), "12.35\u00a0N/m");
  assert.equal(withUnit(3, ""), "3");
  assert.equal(steady(2, 2, "s"), "2.00\u00a0s");
});
