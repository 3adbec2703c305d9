// The picture of one scene after another: what of it is drawn, and from where.
import { Box3, Vector3 } from "three";

import { Bodies } from "./bodies.ts";
import { colourOf } from "./colours.ts";
import { usualOptions, type ViewOptions } from "./options.ts";
import { Overlays } from "./overlays.ts";
import type { Frame, Geometry, SceneMessage } from "./protocol.ts";
import { Stage } from "./stage.ts";
import { Tool } from "./tool.ts";

const nearTool = 0.3; // of the largest body's length: bodies so near are in the picture with the tool
const roomRoundTool = 0.3; // of what the largest body is longer than what is in the picture, on each side

function longest(box: Box3): number {
  const size = box.getSize(new Vector3());
  return Math.max(size.x, size.y, size.z);
}

/** Of the present scene. */
interface Actors {
  bodies: Bodies;
  tool: Tool;
  overlays: Overlays;
}

export class Picture {
  readonly options: ViewOptions = { ...usualOptions };
  readonly stage: Stage;
  private actors: Actors | null = null;
  private name = "";
  private framed = false;
  private last: Frame | null = null;
  private toolPlace = new Vector3();

  /** Throws where the browser has no WebGL. */
  constructor(canvas: HTMLCanvasElement) {
    this.stage = new Stage(canvas);
  }

  /** Takes the place of the scene before; the camera stays where it is if it is the same scene again. */
  setScene(scene: SceneMessage, geometry: Geometry): void {
    if (this.actors) {
      Object.values(this.actors).forEach((actor: Bodies | Tool | Overlays) => actor.dispose());
    }
    this.framed = this.framed && scene.name === this.name;
    this.name = scene.name;
    this.last = null;
    this.actors = {
      bodies: new Bodies(scene, geometry),
      tool: new Tool(scene, geometry),
      overlays: new Overlays(scene, geometry),
    };
    this.stage.scene.add(this.actors.bodies.group, this.actors.tool.group, this.actors.overlays.group);
    this.stage.setGround(scene.ground);
    this.show();
  }

  take(frame: Frame): void {
    if (!this.actors) {
      return;
    }
    this.last = frame;
    if (frame.hand) {
      this.toolPlace.set(...frame.hand.tool);
    }
    this.actors.bodies.take(frame);
    this.actors.overlays.take(frame);
    this.actors.tool.take(frame, this.options, this.stage.heightAt(this.toolPlace));
    if (!this.framed) {
      this.framed = true;
      this.frame(false, true);
    }
    this.stage.touch();
  }

  /** Draws, if there is anything new to be seen; `held`: the viewer moves the tool, and the camera does not follow it. */
  draw(held: boolean): boolean {
    if (this.options.follow && this.framed && !held) {
      this.stage.follow(this.toolPlace);
    }
    return this.stage.draw();
  }

  setOption(option: keyof ViewOptions, on: boolean): void {
    this.options[option] = on;
    this.show();
  }

  /** Whether particles have to be streamed. */
  needsParticles(): boolean {
    return Overlays.wanted(this.options);
  }

  /** Of the arrows, m for a unit; 0: none is drawn. */
  scales(): { force: number; torque: number } {
    return this.actors?.tool.scales() ?? { force: 0, torque: 0 };
  }

  takeColours(): void {
    this.stage.takeColours();
    this.actors?.tool.takeColours();
    this.actors?.overlays.takeColours();
    this.show();
  }

  /** Tool and bodies; or the tool and what is about it, with room for what comes. `turned`: seen from where one usually looks. */
  frame(all: boolean, turned: boolean): void {
    const extents = this.actors?.bodies.extents().filter((one) => !one.isEmpty()) ?? [];
    const box = this.actors?.tool.extent() ?? new Box3();
    const largest = Math.max(0, ...extents.map(longest));
    const about = box.clone().expandByScalar(nearTool * largest);
    extents.filter((one) => all || one.intersectsBox(about)).forEach((one) => box.union(one));
    if (!all) {
      box.expandByScalar(roomRoundTool * Math.max(largest - longest(box), 0));
    }
    this.stage.frame(box, turned);
  }

  private show(): void {
    const { options, actors } = this;
    if (actors) {
      const ink = colourOf("ink");
      const glass = options.ellipsoids || options.groups || options.links;
      actors.bodies.show(options.surfaces, options.wireframe, glass, ink);
      actors.tool.show(options, ink);
      actors.overlays.show(options);
    }
    this.stage.showGround(options.ground);
    if (this.last) {
      actors?.tool.take({ ...this.last, toolSurface: null }, options, this.stage.heightAt(this.toolPlace));
      actors?.overlays.take(this.last);
    }
    this.stage.touch();
  }
}
