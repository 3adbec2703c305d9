// Status line above the picture, and messages about refusals and connection loss.
import type { ConnectionState } from "./connection.ts";
import { element, byId, throttle, setText } from "./dom.ts";
import { type Frame, handSources, type RefusedMessage, type SceneMessage } from "./protocol.ts";
import { formatFixed, withUnit, formatNumber } from "./scale.ts";

const updateInterval = 100; // ms
const refusalDuration = 7000; // ms
const rateInterval = 0.5; // s, simulated

const handText: Record<(typeof handSources)[number], string> = {
  script: "the hand follows the script",
  device: "a device moves the hand",
  mouse: "a mouse moves the hand",
  input: "the hand follows a file",
  still: "the hand does not move",
};

/** Pa; where no vertex is near a contact, less than this is left, and no colour is seen. */
const leastPressure = 0.01;

/** Lengths of the arrows, m per newton and per newton metre, and the pressure of the last colour, Pa; 0: not drawn. */
export interface ArrowScales {
  force: number;
  torque: number;
  pressure: number;
}

export class Status {
  private readonly title = byId("scene-name");
  private readonly state = byId("scene-state");
  private readonly notice = byId("notice");
  private readonly refused = byId("refused");
  private readonly numbers = element("span", { class: "numbers" });
  private readonly contact = element("span", { class: "contact" });
  private readonly others = element("span");
  private readonly arrows = element("span", { class: "quiet" });
  private readonly write = throttle(updateInterval, (shown: { frame: Frame; scales: ArrowScales }) => {
    this.writeFrame(shown.frame);
    setText(this.arrows, arrowLegend(shown.scales));
  });
  private connected = false;
  private mode: SceneMessage["mode"] = "run";
  private rateStart = { time: 0, step: 0 };
  private stepsPerSecond = NaN;
  private refusedTimer = 0;

  constructor() {
    this.state.append(this.numbers, element("span", {}, this.contact, this.others), this.arrows);
  }

  showState(state: ConnectionState): void {
    this.connected = state === "connected";
    document.body.dataset["connection"] = state;
    this.notice.hidden = this.connected;
    if (!this.connected) {
      const lost = state === "lost" || this.notice.dataset["before"] === "true";
      this.notice.dataset["before"] = String(lost);
      setText(this.notice, lost ? "No connection to host-sim. Trying again…" : "Connecting to host-sim…");
    } else {
      this.notice.dataset["before"] = "false";
    }
  }

  showScene(scene: SceneMessage): void {
    this.mode = scene.mode;
    setText(this.title, scene.name);
    this.stepsPerSecond = NaN;
  }

  showFrame(frame: Frame, scales: ArrowScales): void {
    // Use host-sim's own time: a busy browser receives its frames late and in bursts.
    const passed = frame.time - this.rateStart.time;
    if (passed < 0 || frame.step < this.rateStart.step) {
      this.rateStart = { time: frame.time, step: frame.step };
    } else if (passed >= rateInterval) {
      this.stepsPerSecond = ((frame.step - this.rateStart.step) / passed) * (frame.hand?.speed ?? NaN);
      this.rateStart = { time: frame.time, step: frame.step };
    }
    this.write({ frame, scales });
  }

  showRefused(refused: RefusedMessage): void {
    this.showWords(`host-sim refused “${refused.command}”: ${refused.why}`);
  }

  /** Shows words for some seconds. */
  showWords(words: string): void {
    this.refused.textContent = words;
    this.refused.classList.add("shown");
    clearTimeout(this.refusedTimer);
    this.refusedTimer = window.setTimeout(() => this.refused.classList.remove("shown"), refusalDuration);
  }

  private writeFrame(frame: Frame): void {
    const hand = frame.hand;
    const numbers = [formatFixed(frame.time, 2, "s")];
    if (hand) {
      numbers.push(frame.paused ? "paused" : `${formatFixed(hand.speed, 2)} × real time`);
      if (this.mode === "run" && !frame.paused && Number.isFinite(this.stepsPerSecond)) {
        numbers.push(`${formatNumber(this.stepsPerSecond, 3)} steps/s`);
      }
      numbers.push(`${formatFixed(Math.hypot(...hand.handForce), 2, "N")} at the hand`);
    }
    // Write only what has changed.
    setText(this.numbers, numbers.join(" · "));
    setText(this.contact, frame.overconstrained ? "overconstrained" : frame.inContact ? "in contact" : "free");
    setText(this.others, this.detailsOf(frame).join(" · "));
    document.body.classList.toggle("touching", frame.inContact);
  }

  private detailsOf(frame: Frame): string[] {
    const words = [""]; // separator after the contact state
    const hand = frame.hand;
    if (frame.diverged) {
      words.push(this.mode === "play" ? "the replay differs from the recording" : "diverged");
    }
    if (hand) {
      words.push(this.mode === "play" ? "recording" : handText[hand.source]);
      if (hand.lateSteps > 0) {
        words.push(`${formatNumber(hand.lateSteps, 6)} ${hand.lateSteps === 1 ? "step" : "steps"} behind real time`);
      }
      if (hand.viewers > 1) {
        words.push(`${hand.viewers} viewers`);
      }
    }
    return words;
  }
}

/** Legend of the arrows: the length of one newton in the scene. */
function arrowLegend(scales: ArrowScales): string {
  const words: string[] = [];
  if (scales.force > 0) {
    words.push(`force arrow: 1\u00a0N is ${withUnit(1000 * scales.force, "mm", 2)}`);
  }
  if (scales.torque > 0) {
    words.push(`torque arrow: 1\u00a0mN·m is ${withUnit(scales.torque, "mm", 2)}`);
  }
  if (scales.pressure > leastPressure) {
    const [value, unit] = scales.pressure >= 1000 ? [scales.pressure / 1000, "kPa"] : [scales.pressure, "Pa"];
    words.push(`colour: contact pressure, red ${withUnit(value, unit, 2)}`);
  }
  return words.join(" · ");
}
