// The page: puts connection, picture, hand and controls together.
import { Vector3 } from "three";

import type { Actions } from "./actions.ts";
import { Connection, type Listener } from "./connection.ts";
import { createControls } from "./controls.ts";
import { MouseHand } from "./hand.ts";
import { Picture } from "./picture.ts";
import type { Frame, Geometry, SceneMessage } from "./protocol.ts";
import { note, nothingSeen } from "./seen.ts";

class Page {
  private readonly seen = nothingSeen();
  private readonly picture: Picture;
  private readonly connection: Connection;
  private readonly hand: MouseHand;
  private readonly controls: ReturnType<typeof createControls>;
  private scene: SceneMessage | null = null;
  private radius = 0.01; // m, of the first proxy

  constructor(canvas: HTMLCanvasElement) {
    window.haptic = this.seen;
    this.picture = new Picture(canvas);
    this.connection = new Connection(`ws://${location.host}/stream`, this.listener());
    this.hand = new MouseHand(
      this.picture.stage,
      canvas,
      (request) => this.connection.send(request),
      () => this.radius,
      () => this.mayMoveHand(),
    );
    const actions = this.actions();
    this.controls = createControls(actions);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => actions.takeColours());
    this.draw();
    this.connection.open();
  }

  /** A device has the hand before the mouse has. */
  private mayMoveHand(): boolean {
    const { state, control, handSource } = this.seen;
    return state === "connected" && control && handSource !== "device" && this.scene?.mode === "run";
  }

  private actions(): Actions {
    const { picture } = this;
    const { stage } = picture;
    return {
      send: (request) => {
        if (request.type === "script" || request.type === "reset" || request.type === "scene") {
          this.hand.letGo();
        }
        this.connection.send(request);
      },
      setOption: (option, on) => {
        picture.setOption(option, on);
        this.connection.watch(picture.needsParticles(), picture.options.planes);
      },
      option: (option) => picture.options[option],
      frameAll: () => picture.frame(true, false),
      frameTool: () => picture.frame(false, false),
      orbit: (about, up) => stage.orbit(about, up),
      pan: (right, up) => stage.pan(right, up),
      zoom: (factor) => stage.zoom(factor),
      moveHand: (right, up, away) => this.hand.moveBy(right, up, away),
      turnHand: (about, up) => this.hand.turnBy(about, up),
      curlHand: (curl) => this.hand.curlTo(curl),
      takeColours: () => picture.takeColours(),
    };
  }

  private listener(): Listener {
    return {
      onState: (state) => {
        this.seen.state = state;
        this.controls.showState(state);
      },
      onScene: (scene, geometry) => this.takeScene(scene, geometry),
      onFrame: (frame) => this.takeFrame(frame),
      onSamples: (samples) => {
        if (samples.scene === this.scene?.scene) {
          this.controls.showSamples(samples);
        }
      },
      onDevice: (device) => this.controls.showDevice(device),
      onRefused: (refused) => {
        this.seen.refused = refused.why;
        this.controls.showRefused(refused);
      },
      onRecord: (record) => this.controls.showRecord(record),
    };
  }

  private takeScene(scene: SceneMessage, geometry: Geometry): void {
    this.scene = scene;
    this.hand.forget();
    this.picture.setScene(scene, geometry);
    this.seen.scene = scene.name;
    this.seen.control = scene.control;
    this.seen.parameters = {};
    document.title = `${scene.name} - host-sim`;
    this.controls.showScene(scene);
  }

  private takeFrame(frame: Frame): void {
    if (!this.scene || frame.scene !== this.scene.scene) {
      return;
    }
    note(this.seen, frame, this.scene);
    if (frame.hand) {
      this.hand.take(frame.hand);
    }
    this.radius = frame.proxies?.radii[0] ?? this.radius;
    this.picture.take(frame);
    this.seen.arrow = this.picture.scales().force > 0;
    this.controls.showFrame(frame, this.picture.scales());
  }

  private draw(): void {
    requestAnimationFrame(() => this.draw());
    if (this.picture.draw(this.hand.held)) {
      this.seen.pictures += 1;
    }
    if (this.seen.frames === 0) {
      return; // nothing is anywhere yet
    }
    const { stage } = this.picture;
    this.seen.hipOnScreen = stage.onScreen(new Vector3(...this.seen.hip));
    this.seen.toolOnScreen = stage.onScreen(new Vector3(...this.seen.tool));
  }
}

try {
  new Page(document.getElementById("stage") as HTMLCanvasElement);
} catch (error) {
  const notice = document.getElementById("notice");
  if (notice) {
    notice.hidden = false;
    notice.textContent =
      "This browser cannot draw the scene: it has no WebGL 2, or it is switched off. " +
      "(" +
      (error instanceof Error ? error.message : String(error)) +
      ")";
  }
}
