// Pages of other origins and malformed requests have no effect.
import assert from "node:assert/strict";
import { createServer } from "node:http";

import { assertNoComplaints, openView, seen, until } from "./browser.mjs";
import { claim } from "./claims.mjs";
import { startRun } from "./host_sim.mjs";

/** A foreign web server on this machine. */
async function otherSite() {
  const server = createServer((_, response) => response.end("<!doctype html><title>another site</title>"));
  await new Promise((resolve) => server.listen(0, "127.0.0.1", resolve));
  return { server, url: `http://127.0.0.1:${server.address().port}/` };
}

/** Reports whether a stream opens from this page, and how it ends after sending `text`, if given. */
const stream = (page, address, text) =>
  page.evaluate(
    ([at, words]) =>
      new Promise((resolve) => {
        const socket = new WebSocket(at, "haptic-view-1");
        let opened = false;
        socket.onopen = () => {
          opened = true;
          if (words !== undefined) {
            socket.send(words);
          }
        };
        socket.onmessage = () => words === undefined && resolve({ opened, code: null });
        socket.onclose = ({ code }) => resolve({ opened, code });
      }),
    [address, text],
  );

claim("a page of another origin gets no stream, the view's own page does", async (browser) => {
  const { url, port } = await startRun("plane-slide");
  const page = await openView(browser, url);
  const address = `ws://127.0.0.1:${port}/stream`;
  assert.deepEqual(await stream(page, address), { opened: true, code: null });
  const { server, url: elsewhere } = await otherSite();
  try {
    const stranger = await (await browser.newContext()).newPage();
    await stranger.goto(elsewhere);
    assert.equal((await stream(stranger, address)).opened, false, "a page of another origin has a stream");
  } finally {
    server.closeAllConnections?.();
    server.close();
  }
});

claim("a malformed request closes only that viewer's connection", async (browser) => {
  const { url, port } = await startRun("plane-slide");
  const page = await openView(browser, url);
  const rude = await openView(browser, url);
  for (const text of ["{", '{"type":"shutdown"}', '{"type":"step","steps":"all"}', "x".repeat(5000)]) {
    const { opened, code } = await stream(rude, `ws://127.0.0.1:${port}/stream`, text);
    assert.ok(opened && code !== null, `${text.slice(0, 40)} leaves the connection open`);
  }
  const { frames, step } = await seen(page);
  await until(page, (then) => haptic.frames > then.frames + 5 && haptic.step > then.step, "the scene to go on", { frames, step });
  assert.equal((await seen(page)).state, "connected");
});

claim("the page runs only its own script and cannot be embedded in another page", async (browser) => {
  const { url } = await startRun("plane-slide");
  const page = await openView(browser, url);
  assertNoComplaints(page);
  const ran = await page.evaluate(() => {
    const script = document.createElement("script");
    script.textContent = "window.intruded = true";
    document.head.append(script);
    return window.intruded === true;
  });
  assert.equal(ran, false, "a script within the page is run");
  const { server, url: elsewhere } = await otherSite();
  try {
    const stranger = await (await browser.newContext()).newPage();
    await stranger.goto(elsewhere);
    await stranger.evaluate((framed) => {
      const frame = document.createElement("iframe");
      frame.src = framed;
      document.body.append(frame);
      return new Promise((resolve) => (frame.onload = resolve));
    }, url);
    const inside = await Promise.all(stranger.frames().slice(1).map((frame) => frame.evaluate(() => typeof window.haptic)));
    assert.deepEqual(inside, ["undefined"], "another page shows the view within itself");
  } finally {
    server.closeAllConnections?.();
    server.close();
  }
});
