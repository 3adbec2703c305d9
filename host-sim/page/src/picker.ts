// Picking: what a click in the picture selects, the mark on it, and its values.
import { BufferGeometry, Points, PointsMaterial, Vector2, Vector3, Raycaster, BufferAttribute, type Ray } from "three";

import type { Bodies } from "./bodies.ts";
import { colourOf } from "./colours.ts";
import type { Overlays } from "./overlays.ts";
import type { Frame, Geometry, SceneMessage, Triple } from "./protocol.ts";
import { formatFixed } from "./scale.ts";
import { lengthText } from "./scale_marks.ts";
import type { Tool } from "./tool.ts";
import type { Viewport } from "./viewport.ts";

const particleReach = 9; // CSS pixels
const speedTime = 0.05; // s, simulated, over which a speed is measured

type Selection =
  | { kind: "tool" }
  | { kind: "particle"; index: number; body: number }
  | { kind: "body"; body: number; triangle: number; weights: [number, number, number] };

/** What is selected, for the reader: a title and its values, each with a label. */
export interface Readout {
  title: string;
  rows: [string, string][];
}

/** Objects that a click can select. */
export interface Pickable {
  scene: SceneMessage;
  geometry: Geometry;
  bodies: Bodies;
  tool: Tool;
  overlays: Overlays;
}

export class Picker {
  readonly mark = new Points(new BufferGeometry(), new PointsMaterial({ size: 11, sizeAttenuation: false }));
  private selection: Selection | null = null;
  private start = new Vector3(); // m, of the selected point when it was picked
  private measured = { time: NaN, at: new Vector3() };
  private speed = NaN; // m/s

  constructor(private readonly viewport: Viewport) {
    this.mark.geometry.setAttribute("position", new BufferAttribute(new Float32Array(3), 3));
    this.mark.material.depthTest = false;
    this.mark.material.transparent = true;
    this.mark.renderOrder = 4;
    this.mark.frustumCulled = false;
    this.mark.visible = false;
    viewport.scene.add(this.mark);
  }

  clear(): void {
    this.selection = null;
    this.mark.visible = false;
  }

  /** Selects what is at a point of the canvas, CSS pixels; nothing there: clears the selection. */
  pick(x: number, y: number, from: Pickable, particlesShown: boolean): void {
    const { clientWidth: width, clientHeight: height } = this.viewport.canvas;
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2((2 * x) / width - 1, 1 - (2 * y) / height), this.viewport.camera);
    this.selection = (particlesShown ? this.particleAt(x, y, from) : null) ?? surfaceAt(caster.ray, from);
    this.speed = this.measured.time = NaN;
    const at = this.selection && positionOf(this.selection, from);
    if (at) {
      this.start.copy(at);
    }
  }

  /** Moves the mark with the selection, and returns its values; null: nothing is selected. */
  update(frame: Frame, from: Pickable): Readout | null {
    const at = this.selection && positionOf(this.selection, from);
    this.mark.visible = at !== null;
    if (!this.selection || !at) {
      return null;
    }
    this.mark.geometry.getAttribute("position").setXYZ(0, at.x, at.y, at.z);
    this.mark.geometry.getAttribute("position").needsUpdate = true;
    this.mark.material.color.set(colourOf("focus"));
    this.measureSpeed(frame.time, at);
    return this.readout(this.selection, at, frame, from);
  }

  private measureSpeed(time: number, at: Vector3): void {
    const passed = time - this.measured.time;
    if (passed >= speedTime) {
      this.speed = at.distanceTo(this.measured.at) / passed;
    }
    if (!(passed >= 0) || passed >= speedTime) {
      this.measured = { time, at: at.clone() };
    }
  }

  private particleAt(x: number, y: number, from: Pickable): Selection | null {
    let best: Selection | null = null;
    let least = particleReach;
    from.scene.bodies.forEach((info, body) => {
      for (let k = 0; k < info.particles; ++k) {
        const index = info.first_particle + k;
        const pixel = this.viewport.toScreen(from.overlays.positionOf(index));
        const away = Math.hypot(pixel.x - x, pixel.y - y);
        if (away < least) {
          least = away;
          best = { kind: "particle", index, body };
        }
      }
    });
    return best;
  }

  private readout(selection: Selection, at: Vector3, frame: Frame, from: Pickable): Readout {
    const where: [string, string][] = [
      ["Position", tripleText(at.toArray())],
      ["Moved since picked", lengthText(at.distanceTo(this.start))],
      ["Speed", Number.isFinite(this.speed) ? formatFixed(this.speed, 3, "m/s") : "–"],
    ];
    if (selection.kind === "tool") {
      return { title: "Tool", rows: [...where, ...toolRows(frame, from)] };
    }
    const info = from.scene.bodies[selection.body]!;
    if (selection.kind === "particle") {
      return {
        title: `Particle ${selection.index - info.first_particle} of ${info.name}`,
        rows: [...where, ...particleRows(selection.index, from)],
      };
    }
    const counts = `${info.vertices} vertices, ${info.triangles} triangles, ${info.particles} particles`;
    return { title: info.name, rows: [...where, ["Triangle", String(selection.triangle)], ["Body", counts]] };
  }
}

/** The nearest surface, or sphere of the tool, on a ray. */
function surfaceAt(ray: Ray, from: Pickable): Selection | null {
  const body = from.bodies.hit(ray);
  const tool = from.tool.hitDistance(ray);
  if (tool < (body?.distance ?? Infinity)) {
    return { kind: "tool" };
  }
  return body ? { kind: "body", body: body.body, triangle: body.triangle, weights: body.weights } : null;
}

function positionOf(selection: Selection, from: Pickable): Vector3 | null {
  switch (selection.kind) {
    case "tool":
      return from.tool.position();
    case "particle":
      return from.overlays.positionOf(selection.index);
    case "body":
      return from.bodies.pointOn(selection);
  }
}

function tripleText(metres: Triple): string {
  return metres.map((part) => lengthText(part)).join(", ");
}

function toolRows(frame: Frame, { scene }: Pickable): [string, string][] {
  const { hand, proxies } = frame;
  const rows: [string, string][] = [];
  if (hand) {
    rows.push(["Force on the tool", formatFixed(Math.hypot(...hand.force), 3, "N")]);
    rows.push(["Torque on the tool", formatFixed(1000 * Math.hypot(...hand.torque), 2, "mN·m")]);
    rows.push(["Force at the hand", formatFixed(Math.hypot(...hand.handForce), 3, "N")]);
    rows.push(["Hand behind the surface", lengthText(hand.depth)]);
    if (scene.closes) {
      rows.push(["Closed", formatFixed(100 * hand.curl, 0, "%")]);
    }
  }
  if (proxies) {
    const touching = proxies.touches.filter(Boolean).length;
    rows.push(["Spheres that touch", `${touching} of ${proxies.count}`]);
  }
  return rows;
}

function particleRows(index: number, { geometry }: Pickable): [string, string][] {
  const axes = Array.from(geometry.semiAxes.subarray(3 * index, 3 * index + 3)) as Triple;
  const groups = geometry.groups.filter(({ centre, members }) => centre === index || members.includes(index)).length;
  const links = geometry.links.filter((end) => end === index).length;
  return [
    ["Ellipsoid's semi-axes", tripleText(axes)],
    ["In groups", String(groups)],
    ["Links", String(links)],
  ];
}
