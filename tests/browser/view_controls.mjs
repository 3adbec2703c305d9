// The page's controls change the run in host-sim.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import path from "node:path";

import { chooseScene, openView, parameterControls, pause, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { runToEnd, scratchFolder, startRun } from "./host_sim.mjs";

const press = (page, name) => page.locator("#panel button", { hasText: name }).first().click();

claim("pause stops the scene, a step is exactly one, reset restarts", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true });
  await press(page, "Pause");
  await until(page, () => haptic.paused, "the pause");
  const { step, frames } = await seen(page);
  await until(page, (then) => haptic.frames > then + 10, "frames of the pause", frames);
  assert.equal((await seen(page)).step, step, "it goes on while it is paused");
  for (const wanted of [step + 1, step + 2]) {
    await press(page, "Step");
    await until(page, (then) => haptic.step >= then, "the step", wanted);
    const { frames: then } = await seen(page);
    await until(page, (sent) => haptic.frames > sent + 10, "frames after the step", then);
    assert.equal((await seen(page)).step, wanted, "a step is not one");
  }
  await press(page, "Reset");
  await until(page, (then) => haptic.step < then, "the beginning", step);
  await pause(page, false);
  await until(page, () => haptic.step > 3, "the scene to go on");
});

claim("a parameter changed by field or slider arrives in host-sim and at the other viewer", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true });
  const other = await openView(browser, url);
  const key = "coupling.stiffness";
  const before = (await seen(page)).parameters[key];
  const { field, slider } = parameterControls(page, /stiffness/i);
  await field.fill(String(2 * before));
  await field.press("Enter");
  for (const viewer of [page, other]) {
    await until(viewer, (set) => Math.abs(haptic.parameters[set.key] / set.to - 1) < 1e-3, "the stiffness that was typed", {
      key,
      to: 2 * before,
    });
  }
  await slider.press("ArrowLeft");
  await until(other, (set) => haptic.parameters[set.key] < 0.9999 * set.than, "the stiffness that was slid", { key, than: 2 * before });
});

claim("another scene replaces the first, with its own parameters", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true });
  await chooseScene(page, "fish-hold");
  assert.equal(await page.locator("#scene-name").textContent(), "fish-hold");
  const { state, parameters } = await seen(page);
  assert.equal(state, "connected");
  assert.ok(parameters["proxy.radius"] > 0);
});

claim("a record is downloaded as a CSV that host-sim takes as the hand", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true });
  await press(page, "Record");
  await until(page, () => /Stop/.test(document.getElementById("panel").textContent), "the recording to begin");
  const { step } = await seen(page);
  await until(page, (then) => haptic.step > then + 30, "some steps", step);
  await press(page, "Stop");
  const link = page.locator("#panel .records a");
  const [download] = await Promise.all([page.waitForEvent("download"), link.click()]);
  const file = path.join(scratchFolder(), "record.csv");
  await download.saveAs(file);
  const rows = readFileSync(file, "utf8")
    .split("\n")
    .filter((line) => line && !line.startsWith("#"));
  const steps = Number((await link.textContent()).match(/\d+/)[0]);
  assert.equal(rows.length - 1, steps, "rows of the record");
  assert.ok(steps > 20);
  assert.match(rows[0], /^time_s,/);
  await runToEnd(["run", "plane-slide", "--clock", "lockstep", "--steps", "30", "--input", file]);
});

claim("the keyboard alone reaches every control, and runs the scene", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true });
  const focused = new Set();
  for (let k = 0; k < 80 && !(focused.has("Reset") && focused.has("range") && focused.has("select-one")); k++) {
    await page.keyboard.press("Tab");
    focused.add(
      await page.evaluate(() => {
        const { activeElement: at } = document;
        return at instanceof HTMLButtonElement ? at.textContent : (at.type ?? at.id);
      }),
    );
  }
  for (const control of ["Pause", "Step", "Reset", "Record", "range", "select-one"]) {
    assert.ok(focused.has(control), `Tab does not reach ${control}, but ${[...focused].join(", ")}`);
  }
  await page.locator("#viewport").focus();
  await page.keyboard.press(" ");
  await until(page, () => haptic.paused, "the pause that the space bar asks for");
  const { step } = await seen(page);
  await page.keyboard.press(".");
  await until(page, (then) => haptic.step === then + 1, "the step that the full stop asks for", step);
  await page.keyboard.press("?");
  await until(page, () => document.getElementById("help").open, "the list of keys");
  await page.keyboard.press("Escape");
  await until(page, () => !document.getElementById("help").open, "the end of the list");
});

claim("a read-only viewer cannot change anything: controls are disabled, and host-sim refuses", async (browser) => {
  const { url } = await startRun("plane-slide", { control: false });
  const page = await openView(browser, url, { panel: true });
  assert.equal((await seen(page)).control, false);
  for (const name of ["Pause", "Reset", "Record"]) {
    assert.ok(await page.locator("#panel button", { hasText: name }).first().isDisabled(), `${name} can be pressed`);
  }
  const { step } = await seen(page);
  await page.locator("#viewport").focus();
  await page.keyboard.press(" "); // the key sends its request regardless
  await until(page, () => /view-control/.test(haptic.refused), "the refusal");
  await until(page, () => /refused/.test(document.getElementById("refused").textContent), "the words of the refusal");
  await until(page, (then) => haptic.step > then + 5, "the scene to go on", step);
  assert.equal((await seen(page)).paused, false);
});
