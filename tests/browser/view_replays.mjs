// A recording, played with a timeline.
import assert from "node:assert/strict";
import path from "node:path";

import { openView, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { runToEnd, scratchFolder, startView } from "./host_sim.mjs";

claim("the timeline seeks in a recording and reproduces the same moment exactly", async (browser) => {
  const record = path.join(scratchFolder(), "record.csv");
  // Long enough not to end by itself before the page pauses it, on a busy machine too.
  await runToEnd(["run", "plane-slide", "--clock", "lockstep", "--duration", "30", "--record", record]);
  const { url } = await startView(["play", record]);
  const page = await openView(browser, url, { height: 480 });
  const line = page.locator("#timeline input[type=range]");
  assert.ok(await line.isVisible(), "there is no timeline");
  const play = page.locator("#timeline button").nth(1);
  if (!(await seen(page)).paused) {
    await play.click();
  }
  await until(page, () => haptic.paused, "the pause");
  const at = async (time) => {
    await line.fill(String(time));
    await until(page, (wanted) => Math.abs(haptic.time - wanted) < 0.002, `the moment ${time} s`, time);
    const { tool, hip, force, time: then } = await seen(page);
    return { tool, hip, force, then };
  };
  const early = await at(0.5);
  const late = await at(1.5);
  assert.notDeepEqual(early.hip, late.hip, "the hand is at the same place at two moments");
  assert.deepEqual(await at(0.5), early, "the same moment is another one when it is sought again");
  await play.click();
  await until(page, () => haptic.time > 0.8, "the replay to go on");
});
