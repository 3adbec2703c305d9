// Where the camera looks, the marks of depth and scale, and the values of what is clicked.
import assert from "node:assert/strict";

import { assertNoComplaints, openView, pause, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { startRun } from "./host_sim.mjs";
import { difference, hue, ofFirstBody, pictureOf, share } from "./pixels.mjs";

const fishGround = -0.03; // m, of fish-slide.toml

/** The part of a picture within a rectangle of the page, CSS pixels from the picture's corner. */
function partOf({ width, height, data }, { x, y, width: w, height: h }) {
  const [left, top] = [Math.max(0, Math.round(x)), Math.max(0, Math.round(y))];
  const [right, bottom] = [Math.min(width, Math.round(x + w)), Math.min(height, Math.round(y + h))];
  const rows = [];
  for (let row = top; row < bottom; row++) {
    rows.push(data.subarray(3 * (row * width + left), 3 * (row * width + right)));
  }
  return { width: right - left, height: bottom - top, data: Uint8Array.from(rows.flatMap((row) => [...row])) };
}

/** A pixel amid others of a colour. */
function middleOfColour({ width, height, data }, holds) {
  const of = (x, y) => holds(...data.subarray(3 * (y * width + x), 3 * (y * width + x) + 3));
  for (let reach = 12; reach > 0; reach--) {
    for (let y = reach; y < height - reach; y++) {
      for (let x = reach; x < width - reach; x++) {
        const around = [-reach, 0, reach].every((dy) => [-reach, 0, reach].every((dx) => of(x + dx, y + dy)));
        if (around) {
          return { x, y };
        }
      }
    }
  }
  throw new Error("the colour is not in the picture");
}

/** Waits for pictures of the present moment. */
async function drawn(page) {
  const { frames, pictures } = await seen(page);
  // The browser's compositor may be pictures behind the page.
  await until(page, (then) => haptic.frames > then.frames + 20 && haptic.pictures > then.pictures + 6, "pictures after a change", {
    frames,
    pictures,
  });
}

async function drag(page, from, by) {
  const box = await page.locator("#viewport").boundingBox();
  const at = { x: box.x + from.x, y: box.y + from.y };
  await page.mouse.move(at.x, at.y);
  await page.mouse.down();
  await page.mouse.move(at.x + by.x, at.y + by.y, { steps: 8 });
  await page.mouse.up();
  await drawn(page);
}

claim("the subject is clear of the title and of the buttons", async (browser) => {
  const { url } = await startRun("popout-fan"); // tall: it fills the picture's height
  const page = await openView(browser, url, { width: 640, height: 480 });
  await pause(page);
  await page.keyboard.press("l"); // the camera stays where the next key takes it, wherever the tool is
  await page.keyboard.press("f");
  await drawn(page);
  const picture = await pictureOf(page);
  assert.ok(share(picture, ofFirstBody) > 0.02, "the subject is hardly in the picture");
  for (const id of ["#status", "#toggles"]) {
    const covered = partOf(picture, await page.locator(id).boundingBox());
    const hidden = share(covered, ofFirstBody);
    assert.ok(hidden < 0.002, `${(100 * hidden).toFixed(1)} % of ${id} covers the subject`);
  }
});

claim("the camera stays above the ground while that is shown, and may sink below it otherwise", async (browser) => {
  const { url } = await startRun("fish-slide");
  const page = await openView(browser, url);
  const sink = async () => {
    for (let k = 0; k < 3; k++) {
      await drag(page, { x: 60, y: 300 }, { x: 0, y: -290 });
    }
    await page.locator("#viewport").focus();
    for (let k = 0; k < 25; k++) {
      await page.keyboard.press("ArrowDown");
    }
    await drawn(page);
    return (await seen(page)).camera[1];
  };
  const above = await sink();
  assert.ok(above > fishGround, `the camera is at ${above} m`);
  await page.keyboard.press("0");
  const below = await sink();
  assert.ok(below < fishGround, `without the ground the camera stays at ${below} m`);
});

claim("the line from the tool to what is below it is drawn, and gone when it is switched off", async (browser) => {
  const { url } = await startRun("fish-slide");
  const page = await openView(browser, url);
  await pause(page);
  await page.keyboard.press("r"); // the tool is above the fish
  await until(page, () => haptic.step === 0 && haptic.paused, "the beginning");
  await page.keyboard.press("l");
  await drawn(page);
  const withLine = await pictureOf(page);
  await page.keyboard.press("d");
  await drawn(page);
  const changed = difference(withLine, await pictureOf(page));
  assert.ok(changed > 0.0002, `only ${changed} of the picture changes`);
});

claim("a contact colours the surface by its pressure, and not when that is switched off", async (browser) => {
  const { url } = await startRun("fish-slide");
  const page = await openView(browser, url);
  await until(page, () => haptic.inContact && haptic.pressure > 0, "a pressure");
  await pause(page);
  await page.keyboard.press("l");
  await drawn(page);
  const coloured = await pictureOf(page);
  assert.match(await page.locator("#scene-state").textContent(), /contact pressure, red \d/);
  await page.keyboard.press("e");
  await drawn(page);
  const plain = await pictureOf(page);
  assert.ok(share(plain, ofFirstBody) > share(coloured, ofFirstBody) + 0.0005, "the fish has its own colour everywhere");
});

claim("the scale bar has the length that it says: a tool of known size measures as much", async (browser) => {
  const { url } = await startRun("cloth-drop");
  const page = await openView(browser, url, { width: 640, height: 480 });
  await pause(page);
  await page.keyboard.press("r"); // the cloth is far above
  await until(page, () => haptic.step === 0 && haptic.paused, "the beginning");
  for (const key of ["l", "9", "d", "0"]) {
    await page.keyboard.press(key); // the sphere alone, and the camera stays
  }
  await page.keyboard.press("t");
  for (let k = 0; k < 12; k++) {
    await page.keyboard.press("+");
  }
  await drawn(page);
  await page.evaluate(() => document.activeElement?.blur()); // the focus ring has a similar colour
  const { scaleBar, parameters } = await seen(page);
  const digits = scaleBar / 10 ** Math.floor(Math.log10(scaleBar) + 1e-9);
  assert.ok([1, 2, 5].some((round) => Math.abs(digits - round) < 1e-6), `the bar is ${scaleBar} m long`);
  // Pixels of the bar: the longest horizontal run of ink among the marks.
  const bar = await page.evaluate(() => {
    const { width, height } = document.getElementById("marks");
    const { data } = document.getElementById("marks").getContext("2d").getImageData(0, 0, width, height);
    let longest = 0;
    for (let y = 0; y < height; y++) {
      for (let x = 0, run = 0; x < width; x++) {
        run = data[4 * (y * width + x) + 3] > 64 ? run + 1 : 0;
        longest = Math.max(longest, run);
      }
    }
    return longest / devicePixelRatio;
  });
  // The sphere's diameter from the area of its colour.
  const picture = await pictureOf(page);
  const area = share(picture, (r, g, b) => Math.abs((hue(r, g, b) ?? 999) - 36) < 16) * picture.width * picture.height;
  const metres = ((2 * Math.sqrt(area / Math.PI)) / bar) * scaleBar;
  const wanted = 2 * parameters["proxy.radius"];
  assert.ok(Math.abs(metres / wanted - 1) < 0.15, `a tool of ${wanted} m measures ${metres} m by a bar of ${bar} pixels`);
});

claim("a click shows the values of tool or body and moves nothing; a click beside them ends it", async (browser) => {
  const { url } = await startRun("fish-slide");
  const page = await openView(browser, url);
  await pause(page);
  await page.keyboard.press("r"); // nothing is in front of the tool
  await until(page, () => haptic.step === 0 && haptic.paused, "the beginning");
  await page.keyboard.press("l");
  await drawn(page);
  const box = await page.locator("#viewport").boundingBox();
  const { toolOnScreen: at, tool } = await seen(page);
  const card = page.locator("#picked");
  await page.mouse.click(box.x + at.x, box.y + at.y);
  await until(page, () => haptic.picked === "Tool", "the tool's values");
  const position = await card.locator("dd").first().textContent();
  const shown = position.split(",").map((part) => parseFloat(part) * (/mm/.test(part) ? 1e-3 : /µm/.test(part) ? 1e-6 : 1));
  shown.forEach((value, k) => assert.ok(Math.abs(value - tool[k]) < 6e-3 * Math.abs(tool[k]) + 1e-6, `${position} is not ${tool}`));
  assert.equal((await seen(page)).handSource, "script", "a click takes the hand");
  const fish = middleOfColour(await pictureOf(page), ofFirstBody);
  await page.mouse.click(box.x + fish.x, box.y + fish.y);
  await until(page, () => haptic.picked === "fish", "the fish's values");
  assert.match(await card.textContent(), /852 vertices/);
  await page.mouse.click(box.x + box.width - 8, box.y + box.height / 2);
  await until(page, () => haptic.picked === "", "the end of the selection");
  assert.ok(await card.isHidden());
  assertNoComplaints(page);
});
