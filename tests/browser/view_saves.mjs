// What the page saves: pictures, videos and samples of the plots.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import path from "node:path";

import { assertNoComplaints, openView, pause, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { scratchFolder, startRun } from "./host_sim.mjs";
import { ofFirstBody, readPng, share } from "./pixels.mjs";

/** Size of the view, pixels of the screen. */
const sizeOf = (page) =>
  page.evaluate(() => {
    const { clientWidth, clientHeight } = document.getElementById("viewport");
    return [clientWidth, clientHeight].map((part) => Math.round(devicePixelRatio * part));
  });

/** Name and content of the file that `act` saves. */
async function saved(page, act) {
  const [download] = await Promise.all([page.waitForEvent("download"), act()]);
  const file = path.join(scratchFolder(), download.suggestedFilename());
  await download.saveAs(file);
  return { name: download.suggestedFilename(), content: readFileSync(file) };
}

claim("the picture is saved as PNG, as large as the view and with the bodies in it", async (browser) => {
  const { url } = await startRun("fish-hold", { control: false });
  const page = await openView(browser, url);
  const size = await sizeOf(page);
  const { name, content } = await saved(page, () => page.keyboard.press("s"));
  assert.match(name, /^fish-hold-[\d.]+s\.png$/);
  const picture = readPng(content);
  assert.deepEqual([picture.width, picture.height], size);
  const body = share(picture, ofFirstBody);
  assert.ok(body > 0.005, `only ${body} of the saved picture has the colour of the fish`);
  assertNoComplaints(page);
});

claim("a video is recorded and saved, and plays", async (browser) => {
  const { url } = await startRun("fish-slide", { control: false });
  const page = await openView(browser, url);
  await page.keyboard.press("v");
  await until(page, () => haptic.video, "the start of the video");
  const { pictures } = await seen(page);
  await until(page, (then) => haptic.pictures > then + 30, "some pictures", pictures);
  const { name, content } = await saved(page, () => page.keyboard.press("v"));
  assert.match(name, /^fish-slide-[\d.]+s\.(webm|mp4)$/);
  await until(page, () => !haptic.video, "the end of the video");
  // Another page plays it: this one may show nothing that host-sim did not serve.
  const player = await (await browser.newContext()).newPage();
  const [width, height, end] = await player.evaluate(
    ([bytes, type]) =>
      new Promise((resolve, reject) => {
        const video = document.createElement("video");
        video.muted = true;
        video.onended = () => resolve([video.videoWidth, video.videoHeight, video.currentTime]);
        video.onerror = () => reject(new Error(video.error.message));
        video.src = `data:${type};base64,${bytes}`;
        document.body.append(video);
        void video.play();
      }),
    [content.toString("base64"), name.endsWith("webm") ? "video/webm" : "video/mp4"],
  );
  const size = await sizeOf(page);
  assert.deepEqual([width, height], size.map((part) => part & ~1));
  assert.ok(end > 0.3, `the video lasts ${end} s`);
});

claim("dragging in a plot zooms it, CSV saves what it shows, and Live follows the run again", async (browser) => {
  const { url } = await startRun("plane-slide", { control: true });
  const page = await openView(browser, url, { width: 1000, height: 600 });
  await until(page, () => haptic.time > 3.5, "some samples");
  await pause(page);
  const live = page.locator("#plots button", { hasText: "Live" });
  const csv = () => saved(page, () => page.locator("#plots button", { hasText: "CSV" }).click());
  const rowsOf = ({ content }) => {
    const [header, ...rows] = content.toString().trim().split("\n");
    assert.match(header, /^time_s,force_N,/);
    return rows.map((row) => Number(row.split(",")[0]));
  };
  assert.ok(await live.isHidden());
  const whole = rowsOf(await csv());
  const box = await page.locator("#plots .u-over").first().boundingBox();
  // The middle of the samples, wherever they are: a busy machine leaves gaps.
  const [from, to] = [0.3, 0.7].map((share) => whole[Math.floor(share * whole.length)]);
  const at = (time) => [box.x + (time / 6) * box.width, box.y + box.height / 2]; // of 6 s
  await page.mouse.move(...at(from));
  await page.mouse.down();
  await page.mouse.move(...at(to), { steps: 4 });
  await page.mouse.up();
  await live.waitFor();
  const part = rowsOf(await csv());
  assert.ok(part.length > 5 && part.length < whole.length, `${part.length} of ${whole.length} samples`);
  const found = `samples from ${part[0]} to ${part.at(-1)} s, not about ${from} to ${to} s`;
  assert.ok(part[0] > from - 0.1 && part.at(-1) < to + 0.1, found);
  await live.click();
  assert.ok(await live.isHidden());
  assert.equal(rowsOf(await csv()).length, whole.length);
});
