// Tests as claims, one after another in one browser; and how they wait.
import { openBrowser } from "./browser.mjs";
import { stopAll } from "./host_sim.mjs";

const claims = [];

/** `prove` gets the browser; it throws if the claim does not hold. */
export function claim(words, prove) {
  claims.push({ words, prove });
}

/** Whether all hold. A claim that fails leaves the next ones their chance. */
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
