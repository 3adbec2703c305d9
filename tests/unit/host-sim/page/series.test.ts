// Decimation keeps every extreme value, and the history drops old samples.
import assert from "node:assert/strict";
import { test } from "node:test";

import { decimate, History, toCsv } from "../../../../host-sim/page/src/series.ts";

function filled(count: number, step: number, value: (i: number) => number): History {
  const history = new History(1, count);
  for (let i = 0; i < count; ++i) {
    history.push(i * step, [value(i)]);
  }
  return history;
}

test("a full history keeps the newest rows in their order", () => {
  const history = new History(2, 4);
  for (let i = 0; i < 10; ++i) {
    history.push(i, [i, -i]);
  }
  assert.equal(history.length, 4);
  assert.deepEqual([0, 1, 2, 3].map((i) => [history.time(i), history.value(i, 0), history.value(i, 1)]), [[6, 6, -6], [7, 7, -7], [8, 8, -8], [9, 9, -9]]); // prettier-ignore
  assert.equal(history.indexOf(7.5), 2);
  assert.equal(history.indexOf(-1), 0);
  assert.equal(history.indexOf(10), 4);
});

test("a time that goes back clears the history", () => {
  const history = filled(5, 1, () => 1);
  history.push(0.5, [2]);
  assert.equal(history.length, 1);
  assert.equal(history.value(0, 0), 2);
});

test("few samples are returned unchanged", () => {
  const history = filled(10, 1, (i) => i * i);
  const { times, columns } = decimate(history, [0], 2, 5, 100);
  assert.deepEqual(times, [2, 3, 4, 5]);
  assert.deepEqual(columns, [[4, 9, 16, 25]]);
});

test("a single peak among ten thousand samples is in two points a bin, wherever it is", () => {
  for (const peak of [0, 1, 4999, 5000, 7777, 9999]) {
    const history = filled(10000, 0.001, (i) => (i === peak ? 50 : Math.sin(i)));
    const { times, columns } = decimate(history, [0], 0, 10, 200);
    assert.ok(times.length <= 2 * 201, `${times.length} points`);
    assert.equal(Math.max(...(columns[0] as number[])), 50);
    const at = times[columns[0]!.indexOf(50)]!;
    assert.ok(Math.abs(at - peak * 0.001) <= 10 / 200, `the peak of ${peak} is at ${at}`);
    assert.ok(times.every((time, i) => i === 0 || time > times[i - 1]!));
  }
});

test("a plot scrolled by a whole bin keeps its remaining points", () => {
  const history = filled(4000, 0.001, (i) => Math.sin(i * i));
  const width = 2 / 128; // exact in binary, so that bins are the same at both times
  const before = decimate(history, [0], 0, 2, 128);
  const after = decimate(history, [0], width, 2 + width, 128);
  assert.deepEqual(after.columns[0]!.slice(0, 200), before.columns[0]!.slice(2, 202));
});

test("dropped samples break the line", () => {
  const history = new History(1, 10);
  history.push(0, [1]);
  history.gap();
  history.push(1, [2]);
  assert.deepEqual(decimate(history, [0], 0, 1, 100).columns[0], [1, null, 2]);
});

test("CSV has a row for each sample from one time to the other, and empty fields at a gap", () => {
  const history = new History(2, 8);
  history.push(1, [10, 0.5]);
  history.push(2, [20, 0.25]);
  history.gap();
  history.push(3, [30, 0.125]);
  assert.equal(toCsv(history, ["t", "a", "b"], 1.5, 2.5), "t,a,b\n2,20,0.25\n2,,\n");
  assert.equal(toCsv(history, ["t", "a", "b"], -Infinity, Infinity), "t,a,b\n1,10,0.5\n2,20,0.25\n2,,\n3,30,0.125\n");
});
