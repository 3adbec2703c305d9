// Observable state of the page for tests and for the browser's console, e.g. `haptic.force`.
import type { ConnectionState } from "./connection.ts";
import type { Frame, RegionInfo, SceneMessage, Triple } from "./protocol.ts";

export interface PageState {
  state: ConnectionState;
  scene: string;
  control: boolean;
  time: number; // s
  step: number;
  frames: number; // received
  pictures: number; // drawn
  paused: boolean;
  inContact: boolean;
  handSource: string;
  hip: Triple; // m, scene
  tool: Triple; // m, scene
  hipOnScreen: { x: number; y: number }; // CSS pixels of the canvas
  toolOnScreen: { x: number; y: number };
  force: Triple; // N, scene
  torque: Triple; // N*m, scene
  depth: number; // m
  viewers: number;
  parameters: Record<string, number>;
  arrow: boolean; // a force arrow is drawn
  camera: Triple; // m, scene
  scaleBar: number; // m, length of the scale bar
  picked: string; // title of what is selected
  video: boolean; // a video is being recorded
  pressure: number; // Pa, of the last colour; 0: none is shown
  region: RegionInfo | null; // of the device, if it is drawn
  refused: string; // reason of the last refusal
}

declare global {
  interface Window {
    haptic: PageState;
  }
}

export function initialPageState(): PageState {
  return {
    state: "connecting",
    scene: "",
    control: false,
    time: 0,
    step: 0,
    frames: 0,
    pictures: 0,
    paused: false,
    inContact: false,
    handSource: "script",
    hip: [0, 0, 0],
    tool: [0, 0, 0],
    hipOnScreen: { x: 0, y: 0 },
    toolOnScreen: { x: 0, y: 0 },
    force: [0, 0, 0],
    torque: [0, 0, 0],
    depth: 0,
    viewers: 0,
    parameters: {},
    arrow: false,
    camera: [0, 0, 0],
    scaleBar: 0,
    picked: "",
    video: false,
    pressure: 0,
    region: null,
    refused: "",
  };
}

/** Records the content of a frame. */
export function recordFrame(pageState: PageState, frame: Frame, scene: SceneMessage): void {
  pageState.frames += 1;
  pageState.time = frame.time;
  pageState.step = frame.step;
  pageState.paused = frame.paused;
  pageState.inContact = frame.inContact;
  if (frame.hand) {
    pageState.handSource = frame.hand.source;
    pageState.hip = frame.hand.hip;
    pageState.tool = frame.hand.tool;
    pageState.force = frame.hand.force;
    pageState.torque = frame.hand.torque;
    pageState.depth = frame.hand.depth;
    pageState.viewers = frame.hand.viewers;
  }
  frame.parameters?.forEach((value, k) => {
    const parameter = scene.parameters[k];
    if (parameter) {
      pageState.parameters[parameter.key] = value;
    }
  });
}
