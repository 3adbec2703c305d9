// What tests, and whoever is curious, may look at in the browser's console: `haptic.force`.
import type { ConnectionState } from "./connection.ts";
import type { Frame, SceneMessage, Triple } from "./protocol.ts";

export interface Seen {
  state: ConnectionState;
  scene: string;
  control: boolean;
  time: number; // s
  step: number;
  frames: number; // that came
  pictures: number; // that were drawn
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
  refused: string; // why the last request was
}

declare global {
  interface Window {
    haptic: Seen;
  }
}

export function nothingSeen(): Seen {
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
    refused: "",
  };
}

/** Notes what a frame says. */
export function note(seen: Seen, frame: Frame, scene: SceneMessage): void {
  seen.frames += 1;
  seen.time = frame.time;
  seen.step = frame.step;
  seen.paused = frame.paused;
  seen.inContact = frame.inContact;
  if (frame.hand) {
    seen.handSource = frame.hand.source;
    seen.hip = frame.hand.hip;
    seen.tool = frame.hand.tool;
    seen.force = frame.hand.force;
    seen.torque = frame.hand.torque;
    seen.depth = frame.hand.depth;
    seen.viewers = frame.hand.viewers;
  }
  frame.parameters?.forEach((value, k) => {
    const parameter = scene.parameters[k];
    if (parameter) {
      seen.parameters[parameter.key] = value;
    }
  });
}
