// Clicks on the picture, as opposed to drags.

const reach = 4; // CSS pixels that the pointer may move
const patience = 500; // ms between press and release

/** Calls `click` with a point of the canvas, CSS pixels from its upper left corner. */
export function listenToClicks(canvas: HTMLCanvasElement, click: (x: number, y: number) => void): void {
  let press: { x: number; y: number; at: number } | null = null;
  // On the window in the capture phase: handlers of the canvas stop the events that they use.
  window.addEventListener(
    "pointerdown",
    (event) => {
      const taken = event.target === canvas && event.button === 0 && event.isPrimary;
      press = taken ? { x: event.clientX, y: event.clientY, at: event.timeStamp } : null;
    },
    { capture: true },
  );
  window.addEventListener(
    "pointerup",
    (event) => {
      const still = press && Math.hypot(event.clientX - press.x, event.clientY - press.y) < reach;
      if (press && still && event.timeStamp - press.at < patience) {
        const box = canvas.getBoundingClientRect();
        click(event.clientX - box.left, event.clientY - box.top);
      }
      press = null;
    },
    { capture: true },
  );
}
