// Side panel: controls of scene, run, hand, parameters, and what is drawn.
import type { Actions } from "./actions.ts";
import { button, checkbox, element, throttle, setText } from "./dom.ts";
import { meshTypes } from "./mesh_drop.ts";
import { optionLabels, type ViewOptions } from "./options.ts";
import { Parameters } from "./parameters.ts";
import type { Frame, RecordMessage, SceneMessage } from "./protocol.ts";
import { formatFixed } from "./scale.ts";

const updateInterval = 100; // ms
const sendInterval = 50; // ms
const echoDelay = 500; // ms after a change before the state from host-sim is shown again
const mouseHint = "Drag the tool with the mouse; while dragging, the wheel moves it away or nearer.";
const deviceHint = "The device moves the hand; the mouse only rotates the view.";

export interface Panel {
  showScene(scene: SceneMessage): void;
  showFrame(frame: Frame): void;
  showRecord(record: RecordMessage): void;
  showVideo(on: boolean): void;
  /** The actions of the buttons, for the keyboard. */
  togglePause(): void;
  step(): void;
  reset(): void;
  toggleOption(option: keyof ViewOptions): void;
  /** Whether this page may move the hand now. */
  canMoveHand(): boolean;
}

/** Fills `root`; `theme` holds the controls of the page's appearance. */
export function createPanel(root: HTMLElement, actions: Actions, theme: HTMLElement): Panel {
  return new SidePanel(root, actions, theme);
}

class SidePanel implements Panel {
  private readonly scenes = element("select");
  private readonly sceneRow = element("label", { class: "row" }, "Scene", this.scenes);
  private readonly description = element("p", { class: "quiet" });
  private readonly meshFile = element("input", { type: "file", accept: meshTypes });
  private readonly meshRow = element("label", { class: "row" }, "Your mesh", this.meshFile);
  private readonly readOnly = element(
    "p",
    { class: "hint", hidden: true },
    "View only. Start host-sim with ",
    element("code", {}, "--view-control"),
    " to change the scene from this page.",
  );
  private readonly pause = button("Pause", () => this.togglePause());
  private readonly stepButton = button("Step", () => this.step());
  private readonly resetButton = button("Reset", () => this.reset());
  private readonly record = button("Record", () => this.actions.send({ type: "record", on: !this.recording }), {
    title: "Record every step as CSV, which host-sim can play back",
  });
  private readonly video = button("Video", () => this.actions.toggleVideo(), {
    title: "Start a video of the picture; press again to end and save it (key V)",
  });
  private readonly records = element("ul", { class: "records" });
  private readonly handHint = element("p", { class: "quiet" }, mouseHint);
  private readonly curl = element("input", { type: "range", min: 0, max: 1, step: 0.01 });
  private readonly curlRow = element("label", { class: "row" }, "Close the hand", this.curl);
  private readonly parameters: Parameters;
  private readonly parameterPart: HTMLElement;
  private readonly controls: HTMLFieldSetElement;
  private readonly runPart: HTMLElement;
  private readonly handPart: HTMLElement;
  private readonly boxes = new Map<keyof ViewOptions, HTMLInputElement>();
  private readonly write: (frame: Frame) => void;
  private paused = false;
  private pauseRequestedAt = -Infinity; // ms, performance.now() of the last pause or resume
  private recording = false;
  private deviceOwnsHand = false;
  private curlChangedAt = -Infinity;

  constructor(
    root: HTMLElement,
    private readonly actions: Actions,
    theme: HTMLElement,
  ) {
    // Parts of the panel: everything in the fieldset needs --view-control.
    this.parameters = new Parameters(actions);
    this.parameterPart = part("Parameters", this.parameters.root);
    const buttons = element("div", { class: "buttons" }, this.pause, this.stepButton, this.resetButton, this.record);
    this.runPart = part("Run", buttons, this.records);
    this.handPart = this.makeHandPart();
    const fieldset = element("fieldset", { class: "bare" });
    fieldset.append(
      this.sceneRow,
      this.description,
      this.meshRow,
      this.readOnly,
      this.runPart,
      this.handPart,
      this.parameterPart,
    );
    this.controls = fieldset;
    const picture = button("Picture", () => actions.savePicture(), { title: "Save the picture as PNG (key S)" });
    const savePart = part("Save", element("div", { class: "buttons" }, picture, this.video));
    root.append(fieldset, this.makeDrawnPart(), savePart, part("Appearance", theme));
    this.scenes.addEventListener("change", () => this.actions.send({ type: "scene", name: this.scenes.value }));
    this.meshFile.addEventListener("change", () => {
      const file = this.meshFile.files?.[0];
      if (file) {
        this.actions.openMesh(file);
      }
      this.meshFile.value = ""; // the same file can be chosen again
    });
    this.write = throttle(updateInterval, (frame: Frame) => this.writeFrame(frame));
  }

  showScene(scene: SceneMessage): void {
    // The scene list always contains the current scene.
    const names = scene.scenes.includes(scene.name) ? scene.scenes : [scene.name, ...scene.scenes];
    this.scenes.replaceChildren(...names.map((name) => element("option", { value: name }, name)));
    this.scenes.value = scene.name;
    this.sceneRow.hidden = scene.scenes.length === 0;
    this.description.textContent = scene.text;
    // Read-only views disable the controls; a recording has the timeline instead of run and hand.
    this.readOnly.hidden = scene.control;
    this.handHint.hidden = !scene.control;
    this.controls.disabled = !scene.control;
    this.runPart.hidden = scene.mode === "play";
    this.meshRow.hidden = scene.mode === "play" || !scene.control;
    this.handPart.hidden = scene.mode === "play";
    this.curlRow.hidden = !scene.closes;
    this.parameters.show(scene.parameters);
    this.parameterPart.hidden = scene.parameters.length === 0;
    // Disable the options that this scene has no content for.
    const particles = scene.bodies.reduce((sum, body) => sum + body.particles, 0);
    this.enable("particles", particles > 0);
    this.enable("ellipsoids", particles > 0);
    this.enable("groups", scene.groups > 0);
    this.enable("links", scene.links > 0);
    this.enable("proxies", scene.tool.vertices > 0);
    this.enable("ground", scene.ground !== null);
  }

  showFrame(frame: Frame): void {
    if (performance.now() - this.pauseRequestedAt > echoDelay) {
      this.paused = frame.paused;
    }
    this.recording = frame.recording;
    this.write(frame);
  }

  showRecord(record: RecordMessage): void {
    // The address does not change, only its content: just the newest recording is available.
    const link = element("a", { href: record.url, download: "record.csv" }, `Save ${record.steps} steps as CSV`);
    this.records.replaceChildren(element("li", {}, link));
  }

  showVideo(on: boolean): void {
    setText(this.video, on ? "End the video" : "Video");
    this.video.setAttribute("aria-pressed", String(on));
    this.video.classList.toggle("recording", on);
  }

  togglePause(): void {
    const on = !this.paused;
    if (!this.controls.disabled) {
      this.paused = on; // at once, so that a second press has the opposite effect
      this.pauseRequestedAt = performance.now();
    }
    this.actions.send({ type: "pause", on });
  }
  step(): void {
    this.actions.send(this.paused ? { type: "step", steps: 1 } : { type: "pause", on: true });
  }
  reset(): void {
    this.actions.send({ type: "reset" });
  }

  toggleOption(option: keyof ViewOptions): void {
    const box = this.boxes.get(option);
    if (box && !box.disabled) {
      box.checked = !this.actions.option(option);
      this.actions.setOption(option, box.checked);
    }
  }

  canMoveHand(): boolean {
    return !this.controls.disabled && !this.handPart.hidden && !this.deviceOwnsHand;
  }

  private writeFrame(frame: Frame): void {
    this.deviceOwnsHand = frame.hand?.source === "device";
    setText(this.pause, frame.paused ? "Resume" : "Pause");
    this.pause.setAttribute("aria-pressed", String(frame.paused));
    // Recording button with the number of recorded steps.
    const recorded = frame.hand ? ` (${formatFixed(frame.hand.recordedSteps, 0)})` : "";
    setText(this.record, frame.recording ? `Stop${recorded}` : "Record");
    this.record.setAttribute("aria-pressed", String(frame.recording));
    this.record.classList.toggle("recording", frame.recording);
    // Parameters and hand as host-sim has them.
    if (frame.parameters) {
      this.parameters.update(frame.parameters);
    }
    setText(this.handHint, this.deviceOwnsHand ? deviceHint : mouseHint);
    if (frame.hand && performance.now() - this.curlChangedAt > echoDelay) {
      this.curl.valueAsNumber = frame.hand.curl;
    }
  }

  private makeHandPart(): HTMLElement {
    const send = throttle(sendInterval, (curl: number) => this.actions.curlHand(curl));
    this.curl.addEventListener("input", () => {
      this.curlChangedAt = performance.now();
      send(this.curl.valueAsNumber);
    });
    const script = button("Follow the script", () => this.actions.send({ type: "script" }));
    return part("Hand", this.handHint, element("div", { class: "buttons" }, script), this.curlRow);
  }

  private makeDrawnPart(): HTMLElement {
    const boxes = element("div", { class: "checks" });
    for (const { option, label, key, meaning } of optionLabels) {
      const box = checkbox(label, this.actions.option(option), (on) => this.actions.setOption(option, on));
      box.title = `${meaning} (key ${key.toUpperCase()})`;
      this.boxes.set(option, box.querySelector("input")!);
      boxes.append(box);
    }
    const all = button("Whole scene", () => this.actions.frameAll());
    const tool = button("Tool", () => this.actions.frameTool());
    return part("Display", boxes, element("div", { class: "buttons" }, "Look at", all, tool));
  }

  private enable(option: keyof ViewOptions, can: boolean): void {
    const box = this.boxes.get(option);
    if (box) {
      box.disabled = !can;
      box.closest("label")?.classList.toggle("absent", !can);
    }
  }
}

/** A part of the panel that its reader may fold. */
function part(title: string, ...inside: Node[]): HTMLElement {
  return element("details", { open: true }, element("summary", {}, title), ...inside);
}
