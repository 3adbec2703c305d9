// Timeline of a recording that is played.
import type { Actions } from "./actions.ts";
import { button, element, throttle, setText } from "./dom.ts";
import type { Frame, SceneMessage } from "./protocol.ts";
import { formatFixed, formatNumber } from "./scale.ts";

const updateInterval = 50; // ms
const sendInterval = 50; // ms
const echoDelay = 400; // ms after a drag before the slider follows the frames again
const speeds = [0.05, 0.1, 0.25, 0.5, 1, 2, 4];

/** Fills `root`, which is hidden unless a recording is played. */
export class Timeline {
  private readonly play = button("Pause", () => this.togglePlay());
  private readonly back = button("|◀", () => this.seek(0), { "aria-label": "To the start" });
  private readonly line = element("input", {
    type: "range",
    min: 0,
    step: "any",
    "aria-label": "Time of the recording",
  });
  private readonly time = element("output", { class: "numbers" });
  private readonly speed = element("select", { "aria-label": "Speed" });
  private readonly warning = element("p", { class: "warning", role: "status", hidden: true });
  private readonly write = throttle(updateInterval, (frame: Frame) => this.writeFrame(frame));
  private readonly sendSeek: (time: number) => void;
  private length = 0;
  private paused = false;
  private movedAt = -Infinity;

  constructor(
    private readonly root: HTMLElement,
    private readonly actions: Actions,
  ) {
    this.sendSeek = throttle(sendInterval, (time: number) => actions.send({ type: "seek", time }));
    for (const speed of speeds) {
      this.speed.append(element("option", { value: speed }, `${speed} ×`));
    }
    this.speed.value = "1";
    this.speed.addEventListener("change", () => actions.send({ type: "speed", speed: Number(this.speed.value) }));
    this.line.addEventListener("input", () => this.seek(this.line.valueAsNumber));
    root.append(this.back, this.play, this.line, this.time, this.speed, this.warning);
  }

  /** Whether a recording is played. */
  get shown(): boolean {
    return !this.root.hidden;
  }

  showScene(scene: SceneMessage): void {
    this.root.hidden = scene.mode !== "play";
    this.length = scene.length;
    this.line.max = String(scene.length);
    for (const control of [this.play, this.back, this.line, this.speed]) {
      control.disabled = !scene.control;
    }
    this.warning.hidden = true;
  }

  showFrame(frame: Frame): void {
    if (this.shown) {
      this.write(frame);
    }
  }

  private togglePlay(): void {
    if (this.paused && this.line.valueAsNumber >= this.length) {
      this.seek(0);
    }
    this.actions.send({ type: "pause", on: !this.paused });
  }

  private seek(time: number): void {
    this.movedAt = performance.now();
    this.line.valueAsNumber = time;
    this.sendSeek(time);
  }

  private writeFrame(frame: Frame): void {
    this.paused = frame.paused; // with the button's name: a click does what the button says
    setText(this.play, frame.paused ? "Play" : "Pause");
    if (performance.now() - this.movedAt > echoDelay) {
      this.line.valueAsNumber = frame.time;
    }
    setText(this.time, `${formatFixed(frame.time, 2)} of ${formatFixed(this.length, 2, "s")}`);
    const buffered = frame.hand && this.length > 0 ? frame.hand.buffered / this.length : 0;
    this.line.style.setProperty("--buffered", `${formatNumber(100 * Math.min(buffered, 1), 4)}%`);
    this.line.setAttribute("aria-valuetext", `${formatFixed(frame.time, 2)} seconds`);
    this.warning.hidden = !frame.diverged;
    const words = "This replay differs from the recording, which was made by another version or on another machine.";
    setText(this.warning, frame.diverged ? words : "");
  }
}
