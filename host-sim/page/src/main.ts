// Entry point of the page: connects connection, 3D view, hand and controls.
import { Vector3 } from "three";

import type { Actions } from "./actions.ts";
import { Connection, type Listener } from "./connection.ts";
import { createControls } from "./controls.ts";
import { byId } from "./dom.ts";
import { freeArea } from "./free_area.ts";
import { MouseHand } from "./hand.ts";
import { MeshDrop } from "./mesh_drop.ts";
import { Picture } from "./picture.ts";
import type { Frame, Geometry, SceneMessage } from "./protocol.ts";
import { recordFrame, initialPageState } from "./page_state.ts";
import { listenToClicks } from "./clicks.ts";
import { Saver } from "./save.ts";
import { lengthText } from "./scale_marks.ts";

const covers = ["panel", "toggles"]; // may lie over the picture

class Page {
  private readonly pageState = initialPageState();
  private readonly picture: Picture;
  private readonly connection: Connection;
  private readonly hand: MouseHand;
  private readonly saver: Saver;
  private readonly meshes: MeshDrop;
  private readonly controls: ReturnType<typeof createControls>;
  private scene: SceneMessage | null = null;
  private radius = 0.01; // m, of the first proxy

  constructor(canvas: HTMLCanvasElement) {
    window.haptic = this.pageState;
    const marks = byId("marks") as HTMLCanvasElement;
    const boxOf = (id: string): DOMRect => byId(id).getBoundingClientRect();
    this.picture = new Picture(canvas, marks, () =>
      freeArea(canvas.getBoundingClientRect(), boxOf("status"), covers.map(boxOf)),
    );
    this.saver = new Saver(
      this.picture.viewport,
      () => `${this.pageState.scene}-${this.pageState.time.toFixed(2)}s`,
      (on) => {
        this.pageState.video = on;
        this.controls.showVideo(on);
      },
    );
    this.connection = new Connection(`ws://${location.host}/stream`, this.listener());
    this.hand = new MouseHand(
      this.picture.viewport,
      canvas,
      (request) => this.connection.send(request),
      () => this.radius,
      () => this.canMoveHand(),
    );
    this.meshes = new MeshDrop(
      () => this.pageState.control && this.scene?.mode === "run",
      (words, problem) => {
        this.pageState.refused = problem ? words : "";
        this.controls.showWords(words);
      },
    );
    const actions = this.actions();
    this.controls = createControls(actions);
    listenToClicks(canvas, (x, y) => {
      this.picture.pick(x, y);
      this.showPicked();
    });
    const area = new ResizeObserver(() => this.picture.viewport.updateArea());
    ["status", ...covers].forEach((id) => area.observe(byId(id)));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => actions.updateColours());
    this.draw();
    this.connection.open();
  }

  /** A device has precedence over the mouse. */
  private canMoveHand(): boolean {
    const { state, control, handSource } = this.pageState;
    return state === "connected" && control && handSource !== "device" && this.scene?.mode === "run";
  }

  private actions(): Actions {
    const { picture } = this;
    const { viewport } = picture;
    return {
      send: (request) => {
        if (request.type === "script" || request.type === "reset" || request.type === "scene") {
          this.hand.cancel();
        }
        this.connection.send(request);
      },
      setOption: (option, on) => {
        picture.setOption(option, on);
        this.connection.watch(picture.needsParticles(), picture.options.planes);
      },
      option: (option) => picture.options[option],
      frameAll: () => picture.frameView(true, false),
      frameTool: () => picture.frameView(false, false),
      savePicture: () => this.saver.savePicture(),
      toggleVideo: () => {
        try {
          this.saver.toggleVideo();
        } catch (error) {
          this.controls.showRefused({ type: "refused", command: "video", why: (error as Error).message });
        }
      },
      openMesh: (file) => void this.meshes.send(file),
      clearPick: () => {
        picture.clearPick();
        this.showPicked();
      },
      orbit: (about, up) => viewport.orbit(about, up),
      pan: (right, up) => viewport.pan(right, up),
      zoom: (factor) => viewport.zoom(factor),
      moveHand: (right, up, away) => this.hand.moveBy(right, up, away),
      turnHand: (about, up) => this.hand.turnBy(about, up),
      curlHand: (curl) => this.hand.curlTo(curl),
      updateColours: () => picture.updateColours(),
    };
  }

  private listener(): Listener {
    return {
      onState: (state) => {
        this.pageState.state = state;
        this.controls.showState(state);
      },
      onScene: (scene, geometry) => this.setScene(scene, geometry),
      onFrame: (frame) => this.showFrame(frame),
      onSamples: (samples) => {
        if (samples.scene === this.scene?.scene) {
          this.controls.showSamples(samples);
        }
      },
      onDevice: (device) => {
        this.pageState.region = this.picture.showDevice(device) ? device.region : null;
        this.controls.showDevice(device);
      },
      onRefused: (refused) => {
        this.pageState.refused = refused.why;
        this.controls.showRefused(refused);
      },
      onRecord: (record) => this.controls.showRecord(record),
    };
  }

  private setScene(scene: SceneMessage, geometry: Geometry): void {
    this.scene = scene;
    this.hand.reset();
    this.picture.setScene(scene, geometry);
    this.pageState.scene = scene.name;
    this.pageState.control = scene.control;
    this.pageState.parameters = {};
    document.title = `${scene.name} - host-sim`;
    this.controls.showScene(scene);
    this.showPicked();
  }

  private showPicked(): void {
    const readout = this.picture.readout();
    this.pageState.picked = readout?.title ?? "";
    this.controls.showPicked(readout);
  }

  /** While the tool is dragged: how far it is in front of the body behind it. */
  private depthHint(): string {
    const behind = this.hand.holding ? this.picture.bodyBehindTool() : null;
    if (!this.hand.holding) {
      return "";
    }
    const place = behind
      ? `${lengthText(Math.abs(behind.away))} ${behind.away >= 0 ? "in front of" : "behind"} ${behind.name}`
      : "no body is behind the tool";
    return `${place}: the wheel moves the tool away or nearer`;
  }

  private showFrame(frame: Frame): void {
    if (!this.scene || frame.scene !== this.scene.scene) {
      return;
    }
    // Update the observable state, then hand, 3D view and controls.
    recordFrame(this.pageState, frame, this.scene);
    if (frame.hand) {
      this.hand.update(frame.hand);
    }
    this.radius = frame.proxies?.radii[0] ?? this.radius;
    this.picture.update(frame);
    this.pageState.arrow = this.picture.scales().force > 0;
    this.pageState.pressure = this.picture.scales().pressure;
    this.controls.showFrame(frame, this.picture.scales());
    this.showPicked();
    this.controls.showHint(this.depthHint());
  }

  private draw(): void {
    requestAnimationFrame(() => this.draw());
    if (this.saver.recording) {
      this.picture.viewport.invalidate();
    }
    if (this.picture.draw(this.hand.holding)) {
      this.pageState.pictures += 1;
      this.pageState.scaleBar = this.picture.viewport.bar;
      this.saver.addFrame();
    }
    // No pose is known before the first frame.
    if (this.pageState.frames === 0) {
      return;
    }
    const { viewport } = this.picture;
    this.pageState.hipOnScreen = viewport.toScreen(new Vector3(...this.pageState.hip));
    this.pageState.camera = viewport.camera.position.toArray();
    this.pageState.toolOnScreen = viewport.toScreen(new Vector3(...this.pageState.tool));
  }
}

try {
  new Page(document.getElementById("viewport") as HTMLCanvasElement);
} catch (error) {
  const notice = document.getElementById("notice");
  if (notice) {
    notice.hidden = false;
    notice.textContent =
      "This browser cannot draw the scene: WebGL 2 is missing or disabled. " +
      "(" +
      (error instanceof Error ? error.message : String(error)) +
      ")";
  }
}
