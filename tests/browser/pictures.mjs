// Takes pictures of the built-in scenes at given moments: pictures.mjs FOLDER SCENE... A scene is
// NAME@SECONDS[:KEYS[:SCHEME[:page]]]. KEYS are pressed before the picture is taken (arrows as < > ^ v); with "page"
// the panel and the plots are included.
import path from "node:path";

import { openBrowser, openView, pause, seen, unfold, until } from "./browser.mjs";
import { end, startRun } from "./host_sim.mjs";

const arrows = { "<": "ArrowLeft", ">": "ArrowRight", "^": "ArrowUp", v: "ArrowDown" };
const maxSteps = 100; // steps per request
const [folder, ...wanted] = process.argv.slice(2);

/** Steps the scene from its start to the step at this time, through a second stream of the page's own origin. */
async function goTo(page, time) {
  await pause(page);
  await page.evaluate(() => {
    window.stream = new WebSocket(`ws://${location.host}/stream`, "haptic-view-1");
    return new Promise((resolve) => (window.stream.onopen = resolve));
  });
  const ask = (request) => page.evaluate((asked) => window.stream.send(JSON.stringify(asked)), request);
  await ask({ type: "reset" });
  await until(page, () => haptic.step === 0 && haptic.paused, "the beginning");
  await ask({ type: "step", steps: 1 });
  await until(page, () => haptic.step === 1, "the first step");
  const length = (await seen(page)).time;
  for (let left = Math.round(time / length) - 1; left > 0; left -= maxSteps) {
    const { step } = await seen(page);
    const steps = Math.min(left, maxSteps);
    await ask({ type: "step", steps });
    await until(page, (then) => haptic.step === then, `step ${step + steps}`, step + steps);
  }
  await page.evaluate(() => window.stream.close());
}

const browser = await openBrowser();
for (const [k, words] of wanted.entries()) {
  const [moment, keys = "", scheme = "light", whole = ""] = words.split(":");
  const [scene, time] = moment.split("@");
  const started = await startRun(scene);
  const [width, height] = whole ? [1440, 900] : [800, 600];
  const page = await openView(browser, started.url, { width, height, scheme });
  for (const part of ["panel", "plots"]) {
    const button = page.locator(`#toggle-${part}`);
    if (!whole && (await button.getAttribute("aria-expanded")) === "true") {
      await button.click();
    }
  }
  if (whole) {
    await unfold(page, "#toggle-panel");
  }
  await goTo(page, Number(time));
  for (const key of keys) {
    await page.keyboard.press(arrows[key] ?? key);
  }
  const { frames } = await seen(page);
  await until(page, (then) => haptic.frames > then + 90, "the camera to come to rest", frames);
  await page.evaluate(() => document.activeElement?.blur()); // remove the focus ring
  const name = whole ? `${scene}-page` : scene;
  await page.screenshot({ path: path.join(folder, `${name}.png`) });
  const { time: at, force } = await seen(page);
  console.log(`${k + 1} of ${wanted.length}: ${name}.png, ${at.toFixed(2)} s, ${Math.hypot(...force).toFixed(2)} N`);
  await page.context().close();
  await end(started);
}
await browser.close();
