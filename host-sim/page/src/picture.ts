// 3D picture of the current scene: what is drawn, and from where.
import { Box3, Ray, Vector3 } from "three";

import { Bodies } from "./bodies.ts";
import { colourOf } from "./colours.ts";
import { down, DropLine } from "./drop_line.ts";
import { defaultOptions, type ViewOptions } from "./options.ts";
import { Overlays } from "./overlays.ts";
import { Picker, type Readout } from "./picker.ts";
import type { DeviceMessage, Frame, Geometry, SceneMessage } from "./protocol.ts";
import { Region } from "./region.ts";
import type { Area } from "./free_area.ts";
import { Viewport } from "./viewport.ts";
import { Tool } from "./tool.ts";

const nearbyMargin = 0.3; // of the largest body's length: bodies this near to the tool are shown with it
const toolMargin = 0.3; // margin on each side, as a fraction of the difference between the largest body and the shown box

function longestEdge(box: Box3): number {
  const size = box.getSize(new Vector3());
  return Math.max(size.x, size.y, size.z);
}

/** Objects of the current scene. */
interface SceneObjects {
  scene: SceneMessage;
  geometry: Geometry;
  bodies: Bodies;
  tool: Tool;
  overlays: Overlays;
}

/** A body on the line of sight through the tool. */
export interface BodyBehind {
  name: string;
  away: number; // m, from the tool; positive: the tool is in front of it, negative: behind it
}

export class Picture {
  readonly options: ViewOptions = { ...defaultOptions };
  readonly viewport: Viewport;
  private objects: SceneObjects | null = null;
  private name = "";
  private hasFramedView = false;
  private last: Frame | null = null;
  private toolPosition = new Vector3();
  private readonly dropLine = new DropLine();
  private readonly region = new Region();
  private readonly picker: Picker;

  /** `marks`: a canvas over the first, for axes and scale bar. Throws where the browser has no WebGL. */
  constructor(canvas: HTMLCanvasElement, marks: HTMLCanvasElement, measureArea: () => Area) {
    this.viewport = new Viewport(canvas, marks, measureArea);
    this.picker = new Picker(this.viewport);
    this.viewport.scene.add(this.dropLine.group, this.region.lines);
  }

  /** Replaces the scene. The camera keeps its place if the scene has the same name as before. */
  setScene(scene: SceneMessage, geometry: Geometry): void {
    if (this.objects) {
      const { bodies, tool, overlays } = this.objects;
      [bodies, tool, overlays].forEach((object) => object.dispose());
    }
    this.picker.clear();
    // Frame the view again only for another scene.
    this.hasFramedView = this.hasFramedView && scene.name === this.name;
    this.name = scene.name;
    this.last = null;
    this.objects = {
      scene,
      geometry,
      bodies: new Bodies(scene, geometry),
      tool: new Tool(scene, geometry),
      overlays: new Overlays(scene, geometry),
    };
    this.viewport.scene.add(this.objects.bodies.group, this.objects.tool.group, this.objects.overlays.group);
    this.viewport.setGround(scene.ground);
    this.show();
  }

  update(frame: Frame): void {
    if (!this.objects) {
      return;
    }
    this.last = frame;
    if (frame.hand) {
      this.toolPosition.set(...frame.hand.tool);
    }
    this.objects.bodies.update(frame, this.options.pressure);
    this.objects.overlays.update(frame);
    this.objects.tool.update(frame, this.options, this.viewport.viewHeightAt(this.toolPosition));
    this.updateDropLine();
    if (!this.hasFramedView) {
      this.hasFramedView = true;
      this.frameView(false, true);
    }
    this.viewport.invalidate();
  }

  /** Shows where the device lets the grip move freely; returns whether that is drawn. */
  showDevice(device: DeviceMessage): boolean {
    if (this.region.update(device.region, device.flags.includes("workspace_edge"))) {
      this.viewport.invalidate();
    }
    return this.region.lines.visible;
  }

  /** Draws if anything has changed. `handHeld`: the viewer drags the tool, and the camera does not follow it. */
  draw(handHeld: boolean): boolean {
    if (this.options.follow && this.hasFramedView && !handHeld) {
      this.viewport.follow(this.toolPosition);
    }
    return this.viewport.draw();
  }

  /** Selects what is at a point of the canvas, CSS pixels. */
  pick(x: number, y: number): void {
    if (this.objects) {
      this.picker.pick(x, y, this.objects, this.needsParticles());
      this.viewport.invalidate();
    }
  }
  clearPick(): void {
    this.picker.clear();
    this.viewport.invalidate();
  }

  /** Values of what is selected; null: nothing is. */
  readout(): Readout | null {
    return this.objects && this.last ? this.picker.update(this.last, this.objects) : null;
  }

  /** The nearest body behind the tool as seen by the viewer, otherwise in front of it; null: neither. */
  bodyBehindTool(): BodyBehind | null {
    if (!this.objects) {
      return null;
    }
    const eye = this.viewport.camera.position;
    const ray = new Ray(eye, this.toolPosition.clone().sub(eye).normalize());
    const depth = this.toolPosition.distanceTo(eye);
    const { bodies, scene } = this.objects;
    const found = bodies.hit(ray, depth) ?? bodies.hit(ray);
    return found ? { name: scene.bodies[found.body]!.name, away: found.distance - depth } : null;
  }

  private updateDropLine(): void {
    const { objects, options } = this;
    this.dropLine.group.visible = false;
    if (objects && this.last && options.dropLine) {
      const below = objects.bodies.hit(new Ray(this.toolPosition, down));
      this.dropLine.update(this.toolPosition, objects.tool.footprint(), below, this.viewport.groundLevel);
    }
  }

  setOption(option: keyof ViewOptions, on: boolean): void {
    this.options[option] = on;
    this.show();
  }

  /** Whether particles must be streamed. */
  needsParticles(): boolean {
    return Overlays.wanted(this.options);
  }

  /** Scales of the arrows, m per unit, and the pressure of the last colour, Pa; 0: none is drawn. */
  scales(): { force: number; torque: number; pressure: number } {
    const { tool, bodies } = this.objects ?? {};
    return { force: 0, torque: 0, ...tool?.scales(), pressure: bodies?.pressureTop() ?? 0 };
  }

  updateColours(): void {
    this.viewport.updateColours();
    this.dropLine.updateColours();
    this.region.updateColours();
    this.objects?.tool.updateColours();
    this.objects?.overlays.updateColours();
    this.show();
  }

  /**
   * Shows tool and bodies, or the tool and its surroundings with a margin. `resetDirection`: from the default
   * direction.
   */
  frameView(all: boolean, resetDirection: boolean): void {
    // Start with the tool, and add all bodies or those nearby.
    const extents = this.objects?.bodies.extents().filter((one) => !one.isEmpty()) ?? [];
    const box = this.objects?.tool.extent() ?? new Box3();
    const largest = Math.max(0, ...extents.map(longestEdge));
    const nearby = box.clone().expandByScalar(nearbyMargin * largest);
    extents.filter((one) => all || one.intersectsBox(nearby)).forEach((one) => box.union(one));
    // Leave room for the bodies that the tool will reach.
    if (!all) {
      box.expandByScalar(toolMargin * Math.max(largest - longestEdge(box), 0));
    }
    this.viewport.frameBox(box, resetDirection);
  }

  private show(): void {
    const { options, objects } = this;
    if (objects) {
      // Bodies are transparent while something inside them is shown.
      const ink = colourOf("ink");
      const glass = options.ellipsoids || options.groups || options.links;
      objects.bodies.show(options.surfaces, options.wireframe, glass, ink);
      objects.tool.show(options, ink);
      objects.overlays.show(options);
    }
    this.viewport.showGround(options.ground);
    this.region.show(options.region);
    // Apply the last frame again, so that newly shown objects are up to date.
    if (this.last) {
      objects?.tool.update({ ...this.last, toolSurface: null }, options, this.viewport.viewHeightAt(this.toolPosition));
      objects?.overlays.update(this.last);
      objects?.bodies.update({ ...this.last, surfaces: new Map() }, options.pressure);
    }
    this.updateDropLine();
    this.viewport.invalidate();
  }
}
