// The page survives a restart of host-sim.
import assert from "node:assert/strict";

import { openView, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { end, startRun } from "./host_sim.mjs";
import { background, pictureOf, share } from "./pixels.mjs";

claim("a restarted host-sim is shown again without a reload", async (browser) => {
  const first = await startRun("plane-slide");
  const page = await openView(browser, first.url);
  await page.evaluate(() => (window.before = true));
  await end(first, "SIGKILL");
  await until(page, () => haptic.state !== "connected", "the loss of the connection");
  await until(page, () => /No connection/.test(document.getElementById("notice").textContent), "the words that it is lost");
  assert.ok(await page.locator("#notice").isVisible());
  const { frames } = await seen(page);
  await startRun("fish-hold", { port: first.port });
  await until(page, (then) => haptic.state === "connected" && haptic.scene === "fish-hold" && haptic.frames > then, "the new scene", frames);
  const { pictures } = await seen(page);
  await until(page, (then) => haptic.pictures > then, "its picture", pictures);
  assert.ok(await page.evaluate(() => window.before), "the page was reloaded");
  assert.ok(await page.locator("#notice").isHidden(), "it still says that the connection is lost");
  const picture = await pictureOf(page);
  const [red, green, blue] = background(picture);
  assert.ok(share(picture, (r, g, b) => Math.abs(r - red) + Math.abs(g - green) + Math.abs(b - blue) > 40) > 0.01, "nothing is drawn");
});

claim("a stopped host-sim says goodbye and exits cleanly with viewers connected", async (browser) => {
  const started = await startRun("plane-slide");
  const page = await openView(browser, started.url);
  assert.equal(await end(started), 0, started.log);
  await until(page, () => haptic.state !== "connected", "the end of the connection");
});
