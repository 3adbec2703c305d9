// 3D picture of the current scene: what is drawn, and from where.
import { Box3, Vector3 } from "three";

import { Bodies } from "./bodies.ts";
import { colourOf } from "./colours.ts";
import { defaultOptions, type ViewOptions } from "./options.ts";
import { Overlays } from "./overlays.ts";
import type { Frame, Geometry, SceneMessage } from "./protocol.ts";
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
  bodies: Bodies;
  tool: Tool;
  overlays: Overlays;
}

export class Picture {
  readonly options: ViewOptions = { ...defaultOptions };
  readonly viewport: Viewport;
  private objects: SceneObjects | null = null;
  private name = "";
  private hasFramedView = false;
  private last: Frame | null = null;
  private toolPosition = new Vector3();

  /** Throws where the browser has no WebGL. */
  constructor(canvas: HTMLCanvasElement) {
    this.viewport = new Viewport(canvas);
  }

  /** Replaces the scene. The camera keeps its place if the scene has the same name as before. */
  setScene(scene: SceneMessage, geometry: Geometry): void {
    if (this.objects) {
      Object.values(this.objects).forEach((object: Bodies | Tool | Overlays) => object.dispose());
    }
    // Frame the view again only for another scene.
    this.hasFramedView = this.hasFramedView && scene.name === this.name;
    this.name = scene.name;
    this.last = null;
    this.objects = {
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
    this.objects.bodies.update(frame);
    this.objects.overlays.update(frame);
    this.objects.tool.update(frame, this.options, this.viewport.viewHeightAt(this.toolPosition));
    if (!this.hasFramedView) {
      this.hasFramedView = true;
      this.frameView(false, true);
    }
    this.viewport.invalidate();
  }

  /** Draws if anything has changed. `handHeld`: the viewer drags the tool, and the camera does not follow it. */
  draw(handHeld: boolean): boolean {
    if (this.options.follow && this.hasFramedView && !handHeld) {
      this.viewport.follow(this.toolPosition);
    }
    return this.viewport.draw();
  }

  setOption(option: keyof ViewOptions, on: boolean): void {
    this.options[option] = on;
    this.show();
  }

  /** Whether particles must be streamed. */
  needsParticles(): boolean {
    return Overlays.wanted(this.options);
  }

  /** Scales of the arrows, m per unit; 0: none is drawn. */
  scales(): { force: number; torque: number } {
    return this.objects?.tool.scales() ?? { force: 0, torque: 0 };
  }

  updateColours(): void {
    this.viewport.updateColours();
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
    // Apply the last frame again, so that newly shown objects are up to date.
    if (this.last) {
      objects?.tool.update({ ...this.last, toolSurface: null }, options, this.viewport.viewHeightAt(this.toolPosition));
      objects?.overlays.update(this.last);
    }
    this.viewport.invalidate();
  }
}
