// Sliders reach every value of their range; numbers are formatted for readers.
import assert from "node:assert/strict";
import { test } from "node:test";

import {
  sliderPosition,
  rounded,
  type Scale,
  formatFixed,
  valueAtPosition,
  withUnit,
  formatNumber,
} from "../../../../host-sim/page/src/scale.ts";

const linear: Scale = { least: -1, most: 3, whole: false, logarithmic: false };
const logarithmic: Scale = { least: 0.1, most: 1000, whole: false, logarithmic: true };
const fromZero: Scale = { least: 0, most: 200, whole: false, logarithmic: true };
const whole: Scale = { least: 0, most: 50, whole: true, logarithmic: false };

test("both ends of a slider are the ends of the range, exactly", () => {
  const odd: Scale = { least: 0.012345678, most: 9.87654321, whole: false, logarithmic: true };
  for (const scale of [linear, logarithmic, fromZero, whole, odd]) {
    assert.equal(valueAtPosition(scale, 0), scale.least);
    assert.equal(valueAtPosition(scale, 1), scale.most);
    assert.equal(sliderPosition(scale, scale.least), 0);
    assert.equal(sliderPosition(scale, scale.most), 1);
  }
});

test("the middle of a slider is the mean, or the geometric mean", () => {
  assert.equal(valueAtPosition(linear, 0.5), 1);
  assert.equal(valueAtPosition(logarithmic, 0.5), 10);
  assert.equal(valueAtPosition(whole, 0.5), 25);
});

test("converting to a position and back keeps three digits", () => {
  for (const scale of [linear, logarithmic, fromZero]) {
    for (let place = 0.01; place < 1; place += 0.01) {
      const value = valueAtPosition(scale, place);
      const again = valueAtPosition(scale, sliderPosition(scale, value));
      assert.ok(Math.abs(again - value) <= 0.01 * Math.abs(value), `${value} became ${again}`);
    }
  }
});

test("a slider is monotonic", () => {
  for (const scale of [linear, logarithmic, fromZero, whole]) {
    for (let i = 1; i <= 1000; ++i) {
      assert.ok(valueAtPosition(scale, i / 1000) >= valueAtPosition(scale, (i - 1) / 1000));
    }
  }
});

test("values outside the range are clamped to its ends, and a range of one value works", () => {
  assert.equal(sliderPosition(linear, 99), 1);
  assert.equal(sliderPosition(logarithmic, 0), 0);
  assert.equal(sliderPosition({ ...linear, most: -1 }, 5), 0);
  assert.equal(rounded(whole, 50.4), 50);
  assert.equal(rounded({ ...linear, most: 2.99999 }, 2.99999), 2.99999);
});

test("numbers are formatted without rounding noise", () => {
  assert.equal(formatNumber(0.1 + 0.2), "0.3");
  assert.equal(formatNumber(0.029999999329447746), "0.03"); // 0.03 as a float of 32 bits
  assert.equal(formatNumber(1e-7), "1e-7");
  assert.equal(formatNumber(0), "0");
  assert.equal(formatNumber(NaN), "–");
  assert.equal(withUnit(12.3456, "N/m"), "12.35\u00a0N/m");
  assert.equal(withUnit(3, ""), "3");
  assert.equal(formatFixed(2, 2, "s"), "2.00\u00a0s");
});
