// What goes on, in a line or two above the picture; and what went wrong.
import type { ConnectionState } from "./connection.ts";
import { element, found, paced, setText } from "./dom.ts";
import { type Frame, handSources, type RefusedMessage, type SceneMessage } from "./protocol.ts";
import { steady, withUnit, written } from "./scale.ts";

const writeEvery = 100; // ms
const refusedFor = 7000; // ms
const rateOver = 0.5; // s, simulated

const handWords: Record<(typeof handSources)[number], string> = {
  script: "the hand follows the script",
  device: "the hand is the device",
  mouse: "the hand is a mouse",
  input: "the hand follows a file",
  still: "the hand keeps still",
};

/** How long the arrows are: m a newton and m a newton metre; 0 where none is drawn. */
export interface ArrowScales {
  force: number;
  torque: number;
}

export class Status {
  private readonly title = found("scene-name");
  private readonly state = found("scene-state");
  private readonly notice = found("notice");
  private readonly refused = found("refused");
  private readonly numbers = element("span", { class: "numbers" });
  private readonly contact = element("span", { class: "contact" });
  private readonly others = element("span");
  private readonly arrows = element("span", { class: "quiet" });
  private readonly write = paced(writeEvery, (shown: { frame: Frame; scales: ArrowScales }) => {
    this.writeFrame(shown.frame);
    setText(this.arrows, arrowWords(shown.scales));
  });
  private connected = false;
  private mode: SceneMessage["mode"] = "run";
  private since = { time: 0, step: 0 };
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
    // By host-sim's own clocks: a busy browser takes its frames in late and by the heap.
    const passed = frame.time - this.since.time;
    if (passed < 0 || frame.step < this.since.step) {
      this.since = { time: frame.time, step: frame.step };
    } else if (passed >= rateOver) {
      this.stepsPerSecond = ((frame.step - this.since.step) / passed) * (frame.hand?.speed ?? NaN);
      this.since = { time: frame.time, step: frame.step };
    }
    this.write({ frame, scales });
  }

  /** Said politely, and gone after some seconds. */
  showRefused(refused: RefusedMessage): void {
    this.refused.textContent = `host-sim refused “${refused.command}”: ${refused.why}`;
    this.refused.classList.add("shown");
    clearTimeout(this.refusedTimer);
    this.refusedTimer = window.setTimeout(() => this.refused.classList.remove("shown"), refusedFor);
  }

  private writeFrame(frame: Frame): void {
    const hand = frame.hand;
    const numbers = [steady(frame.time, 2, "s")];
    if (hand) {
      numbers.push(frame.paused ? "paused" : `${steady(hand.speed, 2)} × real time`);
      if (this.mode === "run" && !frame.paused && Number.isFinite(this.stepsPerSecond)) {
        numbers.push(`${written(this.stepsPerSecond, 3)} steps/s`);
      }
      numbers.push(`${steady(Math.hypot(...hand.handForce), 2, "N")} at the hand`);
    }
    setText(this.numbers, numbers.join(" · "));
    setText(this.contact, frame.squeezed ? "squeezed" : frame.inContact ? "in contact" : "free");
    setText(this.others, this.wordsOf(frame).join(" · "));
    document.body.classList.toggle("touching", frame.inContact);
  }

  private wordsOf(frame: Frame): string[] {
    const words = [""]; // a separator after the contact
    const hand = frame.hand;
    if (frame.diverged) {
      words.push(this.mode === "play" ? "the replay has left what was recorded" : "diverged");
    }
    if (hand) {
      words.push(this.mode === "play" ? "a recording" : handWords[hand.source]);
      if (hand.lateSteps > 0) {
        words.push(`${written(hand.lateSteps, 6)} late ${hand.lateSteps === 1 ? "step" : "steps"}`);
      }
      words.push(`${hand.viewers} ${hand.viewers === 1 ? "viewer" : "viewers"}`);
    }
    return words;
  }
}

/** The legend of the arrows: how long one newton is in the scene. */
function arrowWords(scales: ArrowScales): string {
  const words: string[] = [];
  if (scales.force > 0) {
    words.push(`force arrow: 1\u00a0N is ${withUnit(1000 * scales.force, "mm", 2)}`);
  }
  if (scales.torque > 0) {
    words.push(`torque arrow: 1\u00a0mN·m is ${withUnit(scales.torque, "mm", 2)}`);
  }
  return words.join(" · ");
}
