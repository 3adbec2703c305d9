// Marks over the picture: the scene's axes and a scale bar, at the lower left.
import { Vector3, type Camera } from "three";

import type { Area } from "./free_area.ts";
import { roundScale } from "./round_scale.ts";
import { withUnit } from "./scale.ts";

const axisLength = 30; // CSS pixels
const maxBar = 130; // CSS pixels
const margin = 16;

/** Colours and font of the page. */
export interface MarkStyle {
  colourOf(name: string): string;
  fontSize: number; // CSS pixels
}

/** A length in the unit that needs the fewest digits. */
export function lengthText(metres: number): string {
  const size = Math.abs(metres);
  return size >= 1
    ? withUnit(metres, "m", 3)
    : size >= 1e-3
      ? withUnit(1e3 * metres, "mm", 3)
      : withUnit(1e6 * metres, "µm", 3);
}

/** Length of the scale bar, m: the longest round one that fits. `metresPerPixel`: at the middle of the view. */
export function barLength(metresPerPixel: number): number {
  return roundScale(maxBar * metresPerPixel);
}

/** Draws the marks onto `context`, in CSS pixels, and returns the length of the bar, m. */
export function drawMarks(
  context: CanvasRenderingContext2D,
  camera: Camera,
  area: Area,
  metresPerPixel: number,
  style: MarkStyle,
): number {
  const ink = style.colourOf("ink");
  const left = area.left + margin;
  const bottom = area.top + area.height - margin;
  context.font = `600 ${style.fontSize}px system-ui, sans-serif`;
  context.lineWidth = 2;
  context.lineCap = "round";
  // Axes, the farthest first, so that the nearest is on top.
  const origin = { x: left + axisLength + 4, y: bottom - axisLength - 4 };
  const axes = (["x", "y", "z"] as const).map((name, k) => {
    const direction = new Vector3().setComponent(k, 1).transformDirection(camera.matrixWorldInverse);
    return { name, direction, colour: style.colourOf(["second", "third", "first"][k]!) };
  });
  axes.sort((one, other) => one.direction.z - other.direction.z);
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (const { name, direction, colour } of axes) {
    context.strokeStyle = context.fillStyle = colour;
    context.beginPath();
    context.moveTo(origin.x, origin.y);
    context.lineTo(origin.x + axisLength * direction.x, origin.y - axisLength * direction.y);
    context.stroke();
    const beyond = axisLength + 0.6 * style.fontSize;
    context.fillText(name, origin.x + beyond * direction.x, origin.y - beyond * direction.y);
  }
  // Scale bar, with its length above.
  const length = barLength(metresPerPixel);
  const pixels = length / metresPerPixel;
  const from = origin.x + axisLength + 26;
  context.strokeStyle = context.fillStyle = ink;
  context.lineWidth = 1.5;
  context.beginPath();
  context.moveTo(from, bottom - 5);
  context.lineTo(from, bottom);
  context.lineTo(from + pixels, bottom);
  context.lineTo(from + pixels, bottom - 5);
  context.stroke();
  context.textBaseline = "bottom";
  context.font = `${style.fontSize}px system-ui, sans-serif`;
  context.fillText(lengthText(length), from + pixels / 2, bottom - 4);
  return length;
}
