// Minimal test runner: claims proved one after another in one browser, and helpers for waiting.
import { openBrowser } from "./browser.mjs";
import { stopAll } from "./host_sim.mjs";

const claims = [];

/** Registers a claim; `prove` is given the browser and throws if the claim does not hold. */
export function claim(words, prove) {
  claims.push({ words, prove });
}

/** Runs all claims, also after a failure; returns whether all hold. */
export async function run() {
  const browser = await openBrowser();
  let held = 0;
  for (const { words, prove } of claims) {
    const began = Date.now();
    let failure = null;
    try {
      await prove(browser);
      held += 1;
    } catch (error) {
      failure = error;
    }
    console.log(`${failure ? "FAILED" : "holds "}  ${words} (${((Date.now() - began) / 1000).toFixed(1)} s)`);
    if (failure) {
      console.log(failure.stack ?? failure);
    }
    for (const context of browser.contexts()) {
      await context.close();
    }
    await stopAll();
  }
  await browser.close();
  console.log(`${held} of ${claims.length} claims hold`);
  return claims.length > 0 && held === claims.length;
}
