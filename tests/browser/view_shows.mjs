// The page shows the simulation.
import assert from "node:assert/strict";

import { assertNoComplaints, chooseScene, openView, pause, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { startRun } from "./host_sim.mjs";
import { background, difference, ofFirstBody, pictureOf, share } from "./pixels.mjs";

const scenes = [
  "cloth-drop",
  "popout-fan",
  "fish-hold",
  "fish-slide",
  "four-fish",
  "curtain-hand",
  "gel-block",
  "organ-lift",
  "plane-slide",
  "rod-gap",
  "fish-grab",
];

// The least that counts as drawn, of the whole picture: a rod of 4 mm fills no more while the tool is far from it.
const leastDrawn = 0.003;
const leastOfBody = 0.0005;

const unlike = ([red, green, blue]) => (r, g, b) => Math.max(Math.abs(r - red), Math.abs(g - green), Math.abs(b - blue)) > 24;

claim("each built-in scene is drawn, its first body in that body's colour, and the console reports no error", async (browser) => {
  const { url } = await startRun(scenes[0]);
  const page = await openView(browser, url, { panel: true });
  const offered = await page.locator("#panel select").first().locator("option").allTextContents();
  assert.deepEqual(offered, scenes, "the scenes that can be chosen");
  await page.keyboard.press("l"); // the camera does not leave the whole scene for the tool
  for (const scene of scenes) {
    if (scene !== scenes[0]) {
      await chooseScene(page, scene);
    }
    // On a busy machine the browser's compositor may be pictures behind the page, and a body that falls leaves the view:
    // look again before judging.
    let drawn = 0;
    let body = 0;
    for (let looks = 0; (drawn <= leastDrawn || body <= leastOfBody) && looks < 5; looks++) {
      await page.keyboard.press("f"); // the whole scene
      const { pictures } = await seen(page);
      await until(page, (before) => haptic.pictures > before + 1, `a picture of all of ${scene}`, pictures);
      const picture = await pictureOf(page);
      drawn = share(picture, unlike(background(picture)));
      body = share(picture, ofFirstBody);
    }
    console.log(`        ${scene}: ${(100 * drawn).toFixed(1)} % drawn, ${(100 * body).toFixed(1)} % in its first body's colour`);
    assert.ok(drawn > leastDrawn, `${scene}: only ${drawn} of the picture is not background`);
    assert.ok(body > leastOfBody, `${scene}: only ${body} of the picture has the colour of its first body`);
  }
  assertNoComplaints(page);
});

claim("the picture moves with the scene and stops with it", async (browser) => {
  const { url } = await startRun("fish-hold");
  const page = await openView(browser, url);
  const first = await pictureOf(page);
  const { time } = await seen(page);
  await until(page, (then) => haptic.time > then + 0.3, "a later moment", time);
  const later = await pictureOf(page);
  assert.ok(difference(first, later) > 0.002, `only ${difference(first, later)} of the picture has changed`);
  await pause(page);
  const { step } = await seen(page);
  // The camera follows the tool and comes to rest slightly later.
  let changed = 1;
  for (let k = 0, last = await pictureOf(page); k < 20 && changed > 0.0005; k++) {
    const { frames } = await seen(page);
    await until(page, (then) => haptic.frames > then + 20, "more frames of the moment", frames);
    const now = await pictureOf(page);
    changed = difference(last, now);
    last = now;
  }
  assert.ok(changed <= 0.0005, `${changed} of the picture of a paused scene changes`);
  assert.equal((await seen(page)).step, step, "a paused scene goes on");
});

claim("light and dark mode follow the reader's system", async (browser) => {
  const { url } = await startRun("plane-slide", { control: false });
  const papers = [];
  for (const scheme of ["light", "dark"]) {
    const page = await openView(browser, url, { scheme });
    papers.push(Math.max(...background(await pictureOf(page))));
  }
  assert.ok(papers[0] > 200, `light paper has a brightness of ${papers[0]} of 255`);
  assert.ok(papers[1] < 80, `dark paper has a brightness of ${papers[1]} of 255`);
});

claim("two viewers see the same moment and the number of viewers", async (browser) => {
  const { url } = await startRun("plane-slide");
  const one = await openView(browser, url);
  const other = await openView(browser, url);
  await until(one, () => haptic.viewers === 2, "the second viewer");
  await pause(one);
  await until(other, () => haptic.paused, "the pause that the other viewer asked for");
  const { step } = await seen(one);
  await until(other, (wanted) => haptic.step === wanted, "the other viewer's step", step);
  const [a, b] = [await seen(one), await seen(other)];
  assert.deepEqual([a.tool, a.hip, a.force, a.time], [b.tool, b.hip, b.force, b.time]);
});
