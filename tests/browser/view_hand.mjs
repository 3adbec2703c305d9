// Mouse and keyboard control of the hand, and meshes to touch with it.
import assert from "node:assert/strict";
import { readFileSync, writeFileSync } from "node:fs";
import path from "node:path";

import { assertNoComplaints, chooseScene, openView, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { scratchFolder, startRun } from "./host_sim.mjs";
import { difference, pictureOf } from "./pixels.mjs";

/** Position of the hand on the screen, in the page's pixels. */
async function handOnScreen(page) {
  const box = await page.locator("#viewport").boundingBox();
  const { hipOnScreen } = await seen(page);
  return { x: box.x + hipOnScreen.x, y: box.y + hipOnScreen.y };
}

const away = (one, other) => Math.hypot(...one.map((value, k) => value - other[k]));

/** Grabs the hand; retries, as a person does, if it moves away. */
async function take(page) {
  for (let attempt = 0; attempt < 20; attempt++) {
    const at = await handOnScreen(page);
    await page.mouse.move(at.x, at.y);
    await page.mouse.down();
    // A press that does not move is a click. The browser joins moves of one frame, so the way back comes later.
    await page.mouse.move(at.x + 5, at.y);
    const { frames } = await seen(page);
    await until(page, (then) => haptic.handSource === "mouse" || haptic.frames > then + 15, "an answer to the mouse", frames);
    if ((await seen(page)).handSource === "mouse") {
      await page.mouse.move(at.x, at.y);
      await resting(page);
      return at;
    }
    await page.mouse.up();
  }
  throw new Error("the mouse cannot take hold of the hand");
}

/** Drops a file onto the page, by the events that a browser makes for a file of another program. */
async function drop(page, file) {
  const data = await page.evaluateHandle(
    ([name, text]) => {
      const transfer = new DataTransfer();
      transfer.items.add(new File([text], name));
      return transfer;
    },
    [path.basename(file), readFileSync(file, "utf8")],
  );
  for (const event of ["dragenter", "dragover", "drop"]) {
    await page.dispatchEvent("#viewport", event, { dataTransfer: data });
  }
}

/** Position of the hand once it has settled: equal in ten frames. */
async function resting(page) {
  let last = await seen(page);
  for (let k = 0; k < 50; k++) {
    await until(page, (then) => haptic.frames > then + 10, "ten more frames", last.frames);
    const now = await seen(page);
    if (away(now.hip, last.hip) < 1e-6) {
      return now.hip;
    }
    last = now;
  }
  throw new Error("the hand does not come to rest");
}

claim("a drag presses the tool against a resting body: the hand moves on, the tool stays, and the force is shown", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url);
  const at = await take(page);
  // Small moves, as of a human hand: up until the hand is clear of the plane, then down until it presses.
  let y = at.y;
  const dragUntil = async (there, pixels) => {
    for (let k = 0; k < 100 && !(await page.evaluate(there)); k++) {
      y += pixels;
      await page.mouse.move(at.x, y);
      const { frames } = await seen(page);
      await until(page, (then) => haptic.frames > then + 1, "the next frames", frames);
    }
  };
  await dragUntil(() => !haptic.inContact && Math.hypot(...haptic.hip.map((v, k) => v - haptic.tool[k])) < 1e-3, -3);
  const before = await seen(page);
  assert.equal(before.inContact, false, "the hand cannot be lifted off the plane");
  await dragUntil(() => haptic.inContact && Math.hypot(...haptic.force) > 0.02, 3);
  await until(page, () => haptic.inContact && Math.hypot(...haptic.force) > 0.02, "a contact force");
  await until(page, () => haptic.arrow, "the force's arrow");
  await until(page, () => /in contact/.test(document.getElementById("scene-state").textContent), "the words 'in contact'");
  await until(
    page,
    () => Number(document.getElementById("scene-state").textContent.match(/([\d.]+)\s*N\b/)?.[1]) > 0,
    "the force in figures",
  );
  const pressed = await seen(page);
  assert.ok(away(pressed.hip, before.hip) > 0.002, `the hand has moved by ${away(pressed.hip, before.hip)} m only`);
  assert.ok(away(pressed.hip, pressed.tool) > 0.0005, "the tool goes with the hand through the plane");
  const push = pressed.tool.map((value, k) => value - pressed.hip[k]);
  const along = push.reduce((sum, value, k) => sum + value * pressed.force[k], 0);
  assert.ok(along > 0, "the force does not push the hand back to the tool");
  await page.mouse.up();
  await until(page, () => haptic.handSource === "mouse", "the hand to stay where it was let go");
});

claim("the force's arrow is in the picture, and gone when it is switched off", async (browser) => {
  const { url } = await startRun("fish-hold");
  const page = await openView(browser, url);
  await until(page, () => haptic.inContact && haptic.arrow && haptic.time > 3, "a force with an arrow");
  await page.keyboard.press(" ");
  await until(page, () => haptic.paused, "the pause");
  const drawn = async () => {
    const { pictures, frames } = await seen(page);
    await until(page, ([then, sent]) => haptic.pictures > then || haptic.frames > sent + 20, "a picture", [pictures, frames]);
    return pictureOf(page);
  };
  const withArrow = await drawn();
  await page.keyboard.press("9");
  const without = await drawn();
  assert.ok(difference(withArrow, without) > 0.0003, "the picture is the same with and without arrows");
});

claim("the wheel moves the dragged hand along the line of sight", async (browser) => {
  const { url } = await startRun("curtain-hand");
  const page = await openView(browser, url);
  await take(page);
  const places = [await resting(page)];
  for (const roll of [-240, 480]) {
    await page.mouse.wheel(0, roll);
    await until(page, (then) => Math.hypot(...haptic.hip.map((v, k) => v - then[k])) > 1e-4, "the hand to move", places.at(-1));
    places.push(await resting(page));
  }
  const moves = [1, 2].map((k) => places[k].map((value, axis) => value - places[k - 1][axis]));
  assert.ok(moves[0].reduce((sum, value, axis) => sum + value * moves[1][axis], 0) < 0, "both ways of the wheel move the hand the same way");
  const twice = away(moves[1], [0, 0, 0]) / away(moves[0], [0, 0, 0]);
  assert.ok(Math.abs(twice - 2) < 0.3, `a roll twice as long moves the hand ${twice} times as far`);
  await page.mouse.up();
});

claim("the keyboard alone moves the hand, and returns it to the script", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true });
  await page.keyboard.press("h");
  await until(page, () => !document.getElementById("hand-mode").hidden, "the words of the hand's keys");
  await page.keyboard.press("ArrowUp");
  await until(page, () => haptic.handSource === "mouse", "the keys to be the hand");
  const before = await seen(page);
  for (let k = 0; k < 3; k++) {
    await page.keyboard.press("ArrowRight");
  }
  await until(page, (then) => Math.hypot(...haptic.hip.map((v, k) => v - then[k])) > 1e-4, "the hand to move", before.hip);
  await page.keyboard.press("Escape");
  await until(page, () => document.getElementById("hand-mode").hidden, "the end of the hand's keys");
  await resting(page); // no key's move is pending any more
  await page.locator("#panel button", { hasText: "Follow the script" }).press("Enter");
  await until(page, () => haptic.handSource === "script", "the script to be the hand again");
});

claim("a chosen scene plays its script, also after the mouse has had the hand", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true, width: 900, height: 500 });
  await take(page);
  await page.mouse.up();
  await chooseScene(page, "fish-hold");
  const { hip, handSource } = await seen(page);
  assert.equal(handSource, "script");
  await until(page, (then) => Math.hypot(...haptic.hip.map((v, k) => v - then[k])) > 0.01, "the script to move the hand", hip);
});

claim("the slider of the hand's closing follows the script", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url, { panel: true });
  await chooseScene(page, "fish-grab"); // whose script starts now
  await until(
    page,
    () => {
      const label = [...document.querySelectorAll("#panel label")].find((one) => one.textContent.includes("Close the hand"));
      return label && Number(label.querySelector("input").value) > 0.2;
    },
    "the slider to move",
  );
});

claim("while the tool is dragged, words say how far it is from the body behind it", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url);
  await take(page);
  await until(
    page,
    () => /\d\s*m{1,2} (in front of|behind) \w/.test(document.getElementById("hand-mode").textContent),
    "the distance to the plane",
  );
  await page.mouse.up();
  await until(page, () => document.getElementById("hand-mode").hidden, "the end of the words");
});

claim("a mesh dropped onto the page becomes a scene, and the mouse presses it", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url);
  const mesh = path.join(scratchFolder(), "my body.obj");
  writeFileSync(mesh, "v 0 0 0\nv 3 0 0\nv 0 3 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  await drop(page, mesh);
  await until(page, () => haptic.scene === "my-body", "the scene of the mesh");
  await until(page, () => haptic.inContact && Math.hypot(...haptic.force) > 0.01, "the script to press it");
  await take(page);
  const { frames } = await seen(page);
  await until(page, (then) => haptic.frames > then + 2, "more frames", frames);
  // Small moves of the mouse: up until the body is free, then down onto it.
  let { x, y } = await handOnScreen(page);
  const dragUntil = async (there, pixels) => {
    for (let k = 0; k < 150 && !(await page.evaluate(there)); k++) {
      y += pixels;
      await page.mouse.move(x, y);
      const { frames: before } = await seen(page);
      await until(page, (then) => haptic.frames > then + 1, "the next frames", before);
    }
  };
  await dragUntil(() => !haptic.inContact && Math.hypot(...haptic.hip.map((v, k) => v - haptic.tool[k])) < 1e-3, -3);
  assert.equal((await seen(page)).inContact, false, "the hand cannot be lifted off the body");
  await dragUntil(() => haptic.inContact && Math.hypot(...haptic.force) > 0.05, 3);
  await until(page, () => haptic.inContact && haptic.handSource === "mouse" && Math.hypot(...haptic.force) > 0.05, "the body to push back");
  await page.mouse.up();
  assertNoComplaints(page);
});

claim("a file that is no mesh is refused with a reason, and the scene goes on", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url);
  const folder = scratchFolder();
  for (const [name, content, why] of [
    ["points.obj", "v 0 0 0\nv 1 0 0\n", "has no triangles"],
    ["notes.txt", "no mesh\n", "not a mesh file"],
  ]) {
    writeFileSync(path.join(folder, name), content);
    await drop(page, path.join(folder, name));
    await until(page, (words) => haptic.refused.includes(words), `the words "${why}"`, why);
  }
  assert.equal((await seen(page)).scene, "plane-slide");
});

claim("without --view-control a dropped mesh changes nothing", async (browser) => {
  const { url } = await startRun("plane-slide", { control: false });
  const page = await openView(browser, url);
  const mesh = path.join(scratchFolder(), "own.obj");
  writeFileSync(mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  await drop(page, mesh);
  await until(page, () => haptic.refused.includes("--view-control"), "the words how to allow it");
  assert.equal((await seen(page)).scene, "plane-slide");
});
