// The mouse, or the keyboard, as the device: drags the hand in the plane of the picture, the wheel moves it into the depth.
import { Quaternion, Vector3 } from "three";

import type { Request } from "./connection.ts";
import type { Hand } from "./protocol.ts";
import type { Stage } from "./stage.ts";

const near = 28; // pixels: so near to the hand, a press takes it
const interval = 16; // ms between two places that are sent
const depthPerWheel = 0.0004; // parts of the picture's height for each pixel that the wheel rolls
const turnPerPixel = 0.01; // rad

export class MouseHand {
  private place: Vector3 | null = null; // m, where we have the hand; null: we do not have it
  private turn = new Quaternion();
  private turned = false;
  private curl: number | null = null;
  private known: Hand | null = null;
  private pointer: number | null = null;
  private last = { x: 0, y: 0 };
  private sent = 0; // ms
  private later: number | null = null; // the timer of a move that waits for its time

  constructor(
    private readonly stage: Stage,
    private readonly canvas: HTMLCanvasElement,
    private readonly send: (request: Request) => void,
    private readonly radiusOf: () => number,
    private readonly allowed: () => boolean,
  ) {
    // Before OrbitControls, which listens to the same events.
    canvas.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    for (const end of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(end, (event) => this.release(event), { capture: true });
    }
    canvas.addEventListener("wheel", (event) => this.wheel(event), { capture: true, passive: false });
  }

  /** What host-sim says of the hand; while we do not move it, it is where the next move begins. */
  take(hand: Hand): void {
    this.known = hand;
    if (this.pointer === null && this.later === null) {
      this.place = null;
      this.turned = false;
    }
  }

  /** Another scene: the hand is where that has it. */
  forget(): void {
    this.letGo();
    this.known = null;
  }

  /** Somebody else is to have the hand: what was not sent yet is not sent any more. */
  letGo(): void {
    if (this.later !== null) {
      clearTimeout(this.later);
      this.later = null;
    }
    this.place = null;
    this.curl = null;
    this.turned = false;
  }

  /** The mouse has hold of the hand. */
  get held(): boolean {
    return this.pointer !== null;
  }

  /** By parts of the picture's height. */
  moveBy(right: number, up: number, away: number): void {
    const place = this.takeHold();
    if (place) {
      place.add(this.stage.acrossPicture(place, right, up));
      place.addScaledVector(this.stage.away(), away * this.stage.heightAt(place));
      this.tell();
    }
  }

  /** About the picture's upright and level axes, rad. */
  turnBy(about: number, up: number): void {
    if (!this.takeHold()) {
      return;
    }
    const level = new Vector3().setFromMatrixColumn(this.stage.camera.matrixWorld, 0);
    const upright = new Vector3().setFromMatrixColumn(this.stage.camera.matrixWorld, 1);
    this.turn.premultiply(new Quaternion().setFromAxisAngle(upright, about));
    this.turn.premultiply(new Quaternion().setFromAxisAngle(level, up));
    this.turned = true;
    this.tell();
  }

  curlTo(curl: number): void {
    if (this.takeHold()) {
      this.curl = curl;
      this.tell();
    }
  }

  private takeHold(): Vector3 | null {
    if (!this.place && this.known && this.allowed()) {
      this.place = new Vector3(...this.known.hip);
      this.turn.fromArray(this.known.hipOrientation);
    }
    return this.place;
  }

  private isNear(event: PointerEvent): boolean {
    if (!this.known) {
      return false;
    }
    const box = this.canvas.getBoundingClientRect();
    return [this.known.hip, this.known.tool].some((where) => {
      const at = new Vector3(...where);
      const pixel = this.stage.onScreen(at);
      const radius = (this.radiusOf() / this.stage.heightAt(at)) * this.canvas.clientHeight;
      return Math.hypot(event.clientX - box.left - pixel.x, event.clientY - box.top - pixel.y) < Math.max(near, radius);
    });
  }

  private press(event: PointerEvent): void {
    if (event.button !== 0 || this.pointer !== null || !this.allowed() || !this.isNear(event) || !this.takeHold()) {
      return;
    }
    event.stopImmediatePropagation();
    this.canvas.setPointerCapture(event.pointerId);
    this.canvas.classList.add("holding");
    this.pointer = event.pointerId;
    this.last = { x: event.clientX, y: event.clientY };
    this.tell();
  }

  private move(event: PointerEvent): void {
    if (event.pointerId !== this.pointer) {
      if (this.pointer === null && event.buttons === 0) {
        this.canvas.classList.toggle("graspable", this.allowed() && this.isNear(event));
      }
      return;
    }
    event.stopImmediatePropagation();
    const right = event.clientX - this.last.x;
    const down = event.clientY - this.last.y;
    this.last = { x: event.clientX, y: event.clientY };
    if (event.shiftKey) {
      this.turnBy(turnPerPixel * right, turnPerPixel * down);
    } else {
      this.moveBy(right / this.canvas.clientHeight, -down / this.canvas.clientHeight, 0);
    }
  }

  private release(event: PointerEvent): void {
    if (event.pointerId !== this.pointer) {
      return;
    }
    event.stopImmediatePropagation();
    this.pointer = null;
    this.canvas.classList.remove("holding");
    this.tell();
    this.send({ type: "release" });
  }

  private wheel(event: WheelEvent): void {
    if (this.pointer === null) {
      return;
    }
    event.preventDefault();
    event.stopImmediatePropagation();
    this.moveBy(0, 0, -depthPerWheel * event.deltaY);
  }

  /** Sends where the hand is; what comes in between is sent when its time has come. */
  private tell(): void {
    const wait = this.sent + interval - performance.now();
    if (wait > 0) {
      this.later ??= setTimeout(() => {
        this.later = null;
        this.tellNow();
      }, wait);
      return;
    }
    this.tellNow();
  }

  private tellNow(): void {
    if (!this.place) {
      return;
    }
    this.sent = performance.now();
    this.send({
      type: "hand",
      position: this.place.toArray(),
      ...(this.turned ? { orientation: [this.turn.w, this.turn.x, this.turn.y, this.turn.z] as const } : {}),
      ...(this.curl === null ? {} : { curl: this.curl }),
    } as Request);
  }
}
