// Free area of the picture: the part that title, panel and buttons leave uncovered.

/** CSS pixels from the canvas' upper left corner. */
export interface Area {
  left: number;
  top: number;
  width: number;
  height: number;
}

const minShare = 0.25; // of the canvas' height: kept even if more is covered

/**
 * The area below the title, and above whatever covers the canvas' lower edge. `covers`: elements that may lie over
 * the canvas; hidden ones do not count.
 */
export function freeArea(canvas: DOMRectReadOnly, title: DOMRectReadOnly, covers: DOMRectReadOnly[]): Area {
  const { width, height } = canvas;
  let top = Math.max(0, title.bottom - canvas.top);
  let bottom = height;
  for (const cover of covers) {
    const overlaps =
      cover.width > 0 && cover.left < canvas.right - 1 && cover.right > canvas.left && cover.top < canvas.bottom - 1;
    if (overlaps) {
      bottom = Math.min(bottom, cover.top - canvas.top);
    }
  }
  // On a small screen the picture has priority over what covers it.
  const least = minShare * height;
  if (bottom - top < least) {
    top = Math.min(top, height - least);
    bottom = Math.max(bottom, top + least);
  }
  return { left: 0, top, width, height: bottom - top };
}
