// Decoder of screenshots: PNG of 8 bits, RGB or RGBA, not interlaced, as browsers write it.
import assert from "node:assert/strict";
import { inflateSync } from "node:zlib";

/** { width, height, data }: data has three bytes per pixel, red, green and blue. */
export function readPng(png) {
  const parts = [];
  for (let at = 8; at < png.length; at += 12 + png.readUInt32BE(at)) {
    if (png.toString("latin1", at + 4, at + 8) === "IDAT") {
      parts.push(png.subarray(at + 8, at + 8 + png.readUInt32BE(at)));
    }
  }
  const [width, height, channels] = [png.readUInt32BE(16), png.readUInt32BE(20), { 2: 3, 6: 4 }[png[25]]];
  assert.ok(png[24] === 8 && channels && png[28] === 0, "a PNG of another kind");
  const rows = unfilter(inflateSync(Buffer.concat(parts)), width * channels, height, channels);
  const data = new Uint8Array(3 * width * height);
  for (let k = 0; k < width * height; k++) {
    data.set(rows.subarray(k * channels, k * channels + 3), 3 * k);
  }
  return { width, height, data };
}

/** The PNG specification's filters: none, left, up, average, Paeth. */
function unfilter(raw, stride, height, channels) {
  const rows = new Uint8Array(stride * height);
  for (let y = 0; y < height; y++) {
    const filter = raw[y * (stride + 1)];
    for (let x = 0; x < stride; x++) {
      const at = y * stride + x;
      const left = x < channels ? 0 : rows[at - channels];
      const up = y === 0 ? 0 : rows[at - stride];
      const corner = x < channels || y === 0 ? 0 : rows[at - stride - channels];
      const guess = [0, left, up, (left + up) >> 1, paeth(left, up, corner)][filter];
      rows[at] = raw[y * (stride + 1) + 1 + x] + guess;
    }
  }
  return rows;
}

function paeth(left, up, corner) {
  const guess = left + up - corner;
  const [a, b, c] = [Math.abs(guess - left), Math.abs(guess - up), Math.abs(guess - corner)];
  return a <= b && a <= c ? left : b <= c ? up : corner;
}

/** Screenshot of the scene without the elements over it. */
export async function pictureOf(page) {
  const showAround = (shown) =>
    page.evaluate((visibility) => {
      for (const around of document.querySelectorAll("body > :not(main)")) {
        around.style.visibility = visibility;
      }
    }, shown ? "" : "hidden");
  await showAround(false);
  const png = await page.locator("#viewport").screenshot();
  await showAround(true);
  return readPng(png);
}

/** The most frequent colour, [red, green, blue] of 0 to 255. */
export function background({ data }) {
  const counts = new Map();
  for (let k = 0; k < data.length; k += 3) {
    const colour = (data[k] << 16) | (data[k + 1] << 8) | data[k + 2];
    counts.set(colour, (counts.get(colour) ?? 0) + 1);
  }
  const [colour] = [...counts].reduce((top, one) => (one[1] > top[1] ? one : top));
  return [colour >> 16, (colour >> 8) & 255, colour & 255];
}

/** The fraction of the pixels for which holds(red, green, blue) is true. */
export function share({ data }, holds) {
  let count = 0;
  for (let k = 0; k < data.length; k += 3) {
    count += holds(data[k], data[k + 1], data[k + 2]) ? 1 : 0;
  }
  return (3 * count) / data.length;
}

/** The fraction of the pixels in which two pictures of equal size differ by more than noise. */
export function difference(one, other) {
  assert.deepEqual([one.width, one.height], [other.width, other.height]);
  let count = 0;
  for (let k = 0; k < one.data.length; k += 3) {
    const difference = Math.max(...[0, 1, 2].map((c) => Math.abs(one.data[k + c] - other.data[k + c])));
    count += difference > 8 ? 1 : 0;
  }
  return (3 * count) / one.data.length;
}

/** Hue in degrees, 0 red, 120 green, 240 blue; null for nearly grey colours. */
export function hue(red, green, blue) {
  const max = Math.max(red, green, blue);
  const chroma = max - Math.min(red, green, blue);
  if (chroma < 24) {
    return null;
  }
  const sixth =
    max === red ? (green - blue) / chroma : max === green ? 2 + (blue - red) / chroma : 4 + (red - green) / chroma;
  return (60 * sixth + 360) % 360;
}

const firstBodyHue = 203; // degrees, of 0x3d7ea6 in host-sim/page/src/bodies.ts

/** Whether a pixel has the colour of the scene's first body. */
export const ofFirstBody = (r, g, b) => Math.abs((hue(r, g, b) ?? 999) - firstBodyHue) < 20;
