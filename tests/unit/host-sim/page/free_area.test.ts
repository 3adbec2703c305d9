// The part of the picture that nothing covers.
import assert from "node:assert/strict";
import { test } from "node:test";

import { freeArea } from "../../../../host-sim/page/src/free_area.ts";

const box = (left: number, top: number, width: number, height: number): DOMRectReadOnly =>
  ({
    left,
    top,
    width,
    height,
    right: left + width,
    bottom: top + height,
  }) as DOMRectReadOnly;
const canvas = box(0, 0, 800, 600);

test("the title is above the area, what lies over the lower edge is below it", () => {
  const area = freeArea(canvas, box(8, 8, 300, 72), [box(500, 550, 300, 50)]);
  assert.deepEqual(area, { left: 0, top: 80, width: 800, height: 470 });
});

test("what is hidden or beside the canvas covers nothing", () => {
  const area = freeArea(canvas, box(8, 8, 300, 72), [box(0, 0, 0, 0), box(800, 0, 300, 600), box(0, 600, 800, 200)]);
  assert.deepEqual(area, { left: 0, top: 80, width: 800, height: 520 });
});

test("a part of a small picture stays free, even if nearly all of it is covered", () => {
  const area = freeArea(canvas, box(0, 0, 800, 400), [box(0, 300, 800, 300)]);
  assert.equal(area.height, 150);
  assert.ok(area.top + area.height <= 600);
});
