// The page: puts connection, picture, hand and controls together.
import { Box3, Vector3 } from "three";

import type { Actions } from "./actions.ts";
import { Bodies } from "./bodies.ts";
import { colourOf } from "./colours.ts";
import { Connection, type ConnectionState, type Listener } from "./connection.ts";
import { createControls } from "./controls.ts";
import { MouseHand } from "./hand.ts";
import { usualOptions } from "./options.ts";
import { Overlays } from "./overlays.ts";
import type { Frame, Geometry, RefusedMessage, SceneMessage, Triple } from "./protocol.ts";
import { Stage } from "./stage.ts";
import { Tool } from "./tool.ts";

/** What tests, and whoever is curious, may look at in the browser's console: `haptic.force`. */
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

const nothing: Triple = [0, 0, 0];

function start(): void {
  const canvas = document.getElementById("stage") as HTMLCanvasElement;
  const stage = new Stage(canvas);
  const options = { ...usualOptions };
  const seen: Seen = {
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
    hip: nothing,
    tool: nothing,
    hipOnScreen: { x: 0, y: 0 },
    toolOnScreen: { x: 0, y: 0 },
    force: nothing,
    torque: nothing,
    depth: 0,
    viewers: 0,
    parameters: {},
    arrow: false,
    refused: "",
  };
  window.haptic = seen;

  let scene: SceneMessage | null = null;
  let bodies: Bodies | null = null;
  let tool: Tool | null = null;
  let overlays: Overlays | null = null;
  let framed = false;
  let radius = 0.01; // m, of the first proxy
  let lastFrame: Frame | null = null;

  const connection = new Connection(`ws://${location.host}/stream`, listener());
  const hand = new MouseHand(
    stage,
    canvas,
    (request) => connection.send(request),
    () => radius,
    () => seen.state === "connected" && seen.control && seen.handSource !== "device" && scene?.mode === "run",
  );
  const actions: Actions = {
    send: (request) => connection.send(request),
    setOption: (option, on) => {
      options[option] = on;
      show();
      watch();
    },
    option: (option) => options[option],
    frameAll: () => frame(true, false),
    frameTool: () => frame(false, false),
    orbit: (about, up) => stage.orbit(about, up),
    pan: (right, up) => stage.pan(right, up),
    zoom: (factor) => stage.zoom(factor),
    moveHand: (right, up, away) => hand.moveBy(right, up, away),
    turnHand: (about, up) => hand.turnBy(about, up),
    curlHand: (curl) => hand.curlTo(curl),
    takeColours: () => {
      stage.takeColours();
      tool?.takeColours();
      overlays?.takeColours();
      show();
    },
  };
  const controls = createControls(actions);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => actions.takeColours());

  /** What is drawn, as chosen. */
  function show(): void {
    const ink = colourOf("ink");
    bodies?.show(options.surfaces, options.wireframe, options.ellipsoids || options.groups || options.links, ink);
    tool?.show(options, ink);
    overlays?.show(options);
    stage.showGround(options.ground);
    if (lastFrame) {
      tool?.take({ ...lastFrame, toolSurface: null }, options, pictureHeight());
      overlays?.take(lastFrame);
    }
    stage.touch();
  }

  function watch(): void {
    connection.watch(Overlays.wanted(options), options.planes);
  }

  function pictureHeight(): number {
    return stage.heightAt(new Vector3(...seen.tool));
  }

  /** Tool and bodies; or the tool, and round it as much as the largest body takes up. */
  function frame(all: boolean, turned: boolean): void {
    const extents = bodies?.extents().filter((one) => !one.isEmpty()) ?? [];
    const box = tool?.extent() ?? new Box3();
    if (all) {
      extents.forEach((extent) => box.union(extent));
    } else {
      const largest = Math.max(0, ...extents.map(longest));
      const missing = largest - longest(box);
      box.expandByScalar(Math.max(0.3 * missing, 0));
    }
    stage.frame(box, turned);
  }

  function listener(): Listener {
    return {
      onState: (state) => {
        seen.state = state;
        controls.showState(state);
      },
      onScene: (message, geometry) => takeScene(message, geometry),
      onFrame: (message) => takeFrame(message),
      onSamples: (samples) => {
        if (samples.scene === scene?.scene) {
          controls.showSamples(samples);
        }
      },
      onDevice: (device) => controls.showDevice(device),
      onRefused: (refused: RefusedMessage) => {
        seen.refused = refused.why;
        controls.showRefused(refused);
      },
      onRecord: (record) => controls.showRecord(record),
    };
  }

  function takeScene(message: SceneMessage, geometry: Geometry): void {
    framed = framed && message.name === seen.scene;
    bodies?.dispose();
    tool?.dispose();
    overlays?.dispose();
    scene = message;
    bodies = new Bodies(message, geometry);
    tool = new Tool(message, geometry);
    overlays = new Overlays(message, geometry);
    stage.scene.add(bodies.group, tool.group, overlays.group);
    stage.setGround(message.ground);
    hand.forget();
    lastFrame = null;
    seen.scene = message.name;
    seen.control = message.control;
    document.title = `${message.name} - host-sim`;
    show();
    controls.showScene(message);
  }

  function takeFrame(message: Frame): void {
    if (message.scene !== scene?.scene || !bodies || !tool || !overlays) {
      return;
    }
    lastFrame = message;
    seen.frames += 1;
    seen.time = message.time;
    seen.step = message.step;
    seen.paused = message.paused;
    seen.inContact = message.inContact;
    if (message.hand) {
      seen.handSource = message.hand.source;
      seen.hip = message.hand.hip;
      seen.tool = message.hand.tool;
      seen.force = message.hand.force;
      seen.torque = message.hand.torque;
      seen.depth = message.hand.depth;
      seen.viewers = message.hand.viewers;
      hand.take(message.hand);
    }
    radius = message.proxies?.radii[0] ?? radius;
    message.parameters?.forEach((value, k) => {
      const parameter = scene?.parameters[k];
      if (parameter) {
        seen.parameters[parameter.key] = value;
      }
    });
    bodies.take(message);
    overlays.take(message);
    tool.take(message, options, pictureHeight());
    seen.arrow = tool.scales().force > 0;
    if (!framed) {
      framed = true;
      frame(false, true);
    }
    stage.touch();
    controls.showFrame(message, tool.scales());
  }

  function draw(): void {
    requestAnimationFrame(draw);
    if (options.follow && framed && !hand.held) {
      stage.follow(new Vector3(...seen.tool));
    }
    if (stage.draw()) {
      seen.pictures += 1;
    }
    seen.hipOnScreen = stage.onScreen(new Vector3(...seen.hip));
    seen.toolOnScreen = stage.onScreen(new Vector3(...seen.tool));
  }
  draw();
  connection.open();
}

function longest(box: Box3): number {
  const size = box.getSize(new Vector3());
  return Math.max(size.x, size.y, size.z);
}

try {
  start();
} catch (error) {
  const notice = document.getElementById("notice");
  if (notice) {
    notice.hidden = false;
    notice.textContent =
      "This browser cannot draw the scene: it has no WebGL 2, or it is switched off. " +
      "(" + (error instanceof Error ? error.message : String(error)) + ")";
  }
}
