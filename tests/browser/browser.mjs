// Headless Chromium and pages of the live view in it.
import assert from "node:assert/strict";
import { createRequire } from "node:module";
import path from "node:path";

const patience = 60_000; // ms, timeout of every wait, generous for a busy machine
const { chromium } = createRequire(path.join(process.env.PACKAGES, "package.json"))("playwright-core");

/** Software WebGL. The browser's sandbox does not work for root. */
export function openBrowser() {
  return chromium.launch({
    executablePath: process.env.CHROMIUM,
    chromiumSandbox: process.getuid() !== 0,
    args: [
      "--disable-quic",
      "--no-first-run",
      "--disable-background-networking",
      "--disable-component-update",
      "--disable-sync",
      "--enable-unsafe-swiftshader",
      "--use-angle=swiftshader",
    ],
  });
}

/**
 * The page at `url`, connected and with the scene in its picture. Small, because the processor draws it: `panel` shows the controls
 * that such a page folds away. What its console complains of is in `page.complaints`.
 */
export async function openView(browser, url, { panel = false, scheme = "light", width = 480, height = 360 } = {}) {
  const context = await browser.newContext({
    viewport: { width, height },
    colorScheme: scheme,
    acceptDownloads: true,
  });
  context.setDefaultTimeout(patience);
  const page = await context.newPage();
  page.complaints = [];
  page.on("pageerror", (error) => page.complaints.push(error.message));
  page.on("console", (message) => {
    if (message.type() === "error" || /content security policy/i.test(message.text())) {
      page.complaints.push(message.text());
    }
  });
  await page.goto(url);
  await until(
    page,
    () => haptic.state === "connected" && haptic.frames > 0 && haptic.pictures > 1 && Number.isFinite(haptic.hipOnScreen.x),
    "a picture of the scene",
  );
  if (panel) {
    await unfold(page, "#toggle-panel");
  }
  return page;
}

/** Waits until `condition`, a function evaluated in the page, holds for `argument`; `words` name what it waits for. */
export async function until(page, condition, words, argument = undefined) {
  try {
    await page.waitForFunction(condition, argument, { timeout: patience, polling: 50 });
  } catch (error) {
    const now = await seen(page).catch(() => "the page does not answer");
    throw new Error(`waited in vain for ${words}; the page has ${JSON.stringify(now)} (${error.message})`);
  }
}

/** The page's observable state: window.haptic (host-sim/page/src/page_state.ts). */
export function seen(page) {
  return page.evaluate(() => structuredClone(window.haptic));
}

export async function unfold(page, toggle) {
  const button = page.locator(toggle);
  if ((await button.getAttribute("aria-expanded")) !== "true") {
    await button.click();
  }
}

/** Field and slider of the parameter with this label. */
export function parameterControls(page, label) {
  const row = page.locator(".parameter", { has: page.locator("label", { hasText: label }) }).first();
  return { field: row.locator("input[type=number]"), slider: row.locator("input[type=range]") };
}

export async function chooseScene(page, name) {
  await page.locator("#panel label", { hasText: "Scene" }).locator("select").selectOption(name);
  await until(page, (wanted) => haptic.scene === wanted.name, `the scene ${name}`, { name });
  const { frames } = await seen(page); // until then, those of the scene before
  await until(page, (then) => haptic.frames > then + 2, `frames of ${name}`, frames);
}

/** Pauses host-sim, so that nothing moves. */
export async function pause(page, on = true) {
  const { paused } = await seen(page);
  if (paused !== on) {
    await page.locator("#viewport").press(" "); // focus the canvas: a focused button would take the key
  }
  await until(page, (wanted) => haptic.paused === wanted, on ? "the pause" : "the end of the pause", on);
}

export function assertNoComplaints(page) {
  assert.deepEqual(page.complaints, [], "the browser's console complains");
}
