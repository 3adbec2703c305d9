// Mouse and keyboard control of the hand: dragging moves it in the image plane, the wheel changes its depth.
import { Quaternion, Vector3 } from "three";

import type { Request } from "./connection.ts";
import type { Hand } from "./protocol.ts";
import type { Viewport } from "./viewport.ts";

const grabRadius = 28; // pixels: a press this near to the hand grabs it
const clickReach = 4; // pixels: a press that moves less is a click, and selects
const sendInterval = 16; // ms between two poses that are sent
const depthPerWheel = 0.0004; // fraction of the view's height per pixel of wheel motion
const rotationPerPixel = 0.01; // rad

export class MouseHand {
  private position: Vector3 | null = null; // m, where this page holds the hand; null: it does not
  private orientation = new Quaternion();
  private rotated = false;
  private curl: number | null = null;
  private lastHand: Hand | null = null;
  private pointer: number | null = null;
  private pressed: { pointer: number; x: number; y: number } | null = null; // near the hand, and not yet moved
  private last = { x: 0, y: 0 };
  private sentAt = 0; // ms
  private pendingSend: number | null = null; // timer of a delayed send

  constructor(
    private readonly viewport: Viewport,
    private readonly canvas: HTMLCanvasElement,
    private readonly send: (request: Request) => void,
    private readonly radiusOf: () => number,
    private readonly canMove: () => boolean,
  ) {
    // Capture, to handle the events before OrbitControls does.
    canvas.addEventListener("pointerdown", (event) => this.press(event), { capture: true });
    canvas.addEventListener("pointermove", (event) => this.move(event), { capture: true });
    for (const end of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(end, (event) => this.release(event), { capture: true });
    }
    canvas.addEventListener("wheel", (event) => this.wheel(event), { capture: true, passive: false });
  }

  /** Stores the hand's pose from host-sim, which is the start of the next move. */
  update(hand: Hand): void {
    this.lastHand = hand;
    if (this.pointer === null && this.pendingSend === null) {
      this.position = null;
      this.rotated = false;
    }
  }

  /** Another scene: its hand has a pose of its own. */
  reset(): void {
    this.cancel();
    this.lastHand = null;
  }

  /** Gives up control of the hand and drops a pending pose. */
  cancel(): void {
    if (this.pendingSend !== null) {
      clearTimeout(this.pendingSend);
      this.pendingSend = null;
    }
    this.position = null;
    this.curl = null;
    this.rotated = false;
  }

  /** Whether the mouse is dragging the hand. */
  get holding(): boolean {
    return this.pointer !== null;
  }

  /** Moves the hand by fractions of the view's height. */
  moveBy(right: number, up: number, away: number): void {
    const position = this.grab();
    if (position) {
      position.add(this.viewport.screenOffset(position, right, up));
      position.addScaledVector(this.viewport.viewDirection(), away * this.viewport.viewHeightAt(position));
      this.sendPose();
    }
  }

  /** Rotates the hand about the vertical and horizontal axes of the view, rad. */
  turnBy(about: number, up: number): void {
    if (!this.grab()) {
      return;
    }
    const level = new Vector3().setFromMatrixColumn(this.viewport.camera.matrixWorld, 0);
    const upright = new Vector3().setFromMatrixColumn(this.viewport.camera.matrixWorld, 1);
    this.orientation.premultiply(new Quaternion().setFromAxisAngle(upright, about));
    this.orientation.premultiply(new Quaternion().setFromAxisAngle(level, up));
    this.rotated = true;
    this.sendPose();
  }

  curlTo(curl: number): void {
    if (this.grab()) {
      this.curl = curl;
      this.sendPose();
    }
  }

  private grab(): Vector3 | null {
    if (!this.position && this.lastHand && this.canMove()) {
      // Start from the pose of the device or script.
      this.position = new Vector3(...this.lastHand.hip);
      this.orientation.fromArray(this.lastHand.hipOrientation);
    }
    return this.position;
  }

  private isNear(event: PointerEvent): boolean {
    if (!this.lastHand) {
      return false;
    }
    // Distance on the screen to the hip and to the tool.
    const box = this.canvas.getBoundingClientRect();
    return [this.lastHand.hip, this.lastHand.tool].some((where) => {
      const at = new Vector3(...where);
      const pixel = this.viewport.toScreen(at);
      const radius = (this.radiusOf() / this.viewport.viewHeightAt(at)) * this.canvas.clientHeight;
      return (
        Math.hypot(event.clientX - box.left - pixel.x, event.clientY - box.top - pixel.y) < Math.max(grabRadius, radius)
      );
    });
  }

  /** A press near the hand grabs it with its first move; without a move it is a click. */
  private press(event: PointerEvent): void {
    if (event.button !== 0 || this.pointer !== null || !this.canMove() || !this.isNear(event)) {
      return;
    }
    event.stopImmediatePropagation();
    this.canvas.setPointerCapture(event.pointerId);
    this.pressed = { pointer: event.pointerId, x: event.clientX, y: event.clientY };
  }

  private begin(event: PointerEvent): void {
    const { x, y } = this.pressed!;
    if (Math.hypot(event.clientX - x, event.clientY - y) < clickReach || !this.grab()) {
      return;
    }
    this.pressed = null;
    this.canvas.classList.add("holding");
    this.pointer = event.pointerId;
    this.last = { x, y };
  }

  private move(event: PointerEvent): void {
    if (event.pointerId === this.pressed?.pointer) {
      event.stopImmediatePropagation();
      this.begin(event);
    }
    if (event.pointerId !== this.pointer) {
      if (this.pointer === null && event.buttons === 0) {
        this.canvas.classList.toggle("graspable", this.canMove() && this.isNear(event));
      }
      return;
    }
    event.stopImmediatePropagation();
    const right = event.clientX - this.last.x;
    const down = event.clientY - this.last.y;
    this.last = { x: event.clientX, y: event.clientY };
    if (event.shiftKey) {
      this.turnBy(rotationPerPixel * right, rotationPerPixel * down);
    } else {
      this.moveBy(right / this.canvas.clientHeight, -down / this.canvas.clientHeight, 0);
    }
  }

  private release(event: PointerEvent): void {
    this.pressed = null;
    if (event.pointerId !== this.pointer) {
      return;
    }
    event.stopImmediatePropagation();
    this.pointer = null;
    this.canvas.classList.remove("holding");
    this.sendPose();
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

  /** Sends the pose of the hand; poses between two intervals are merged into the next send. */
  private sendPose(): void {
    const wait = this.sentAt + sendInterval - performance.now();
    if (wait > 0) {
      this.pendingSend ??= setTimeout(() => {
        this.pendingSend = null;
        this.sendPoseNow();
      }, wait);
      return;
    }
    this.sendPoseNow();
  }

  private sendPoseNow(): void {
    if (!this.position) {
      return;
    }
    this.sentAt = performance.now();
    this.send({
      type: "hand",
      position: this.position.toArray(),
      ...(this.rotated
        ? { orientation: [this.orientation.w, this.orientation.x, this.orientation.y, this.orientation.z] as const }
        : {}),
      ...(this.curl === null ? {} : { curl: this.curl }),
    } as Request);
  }
}
