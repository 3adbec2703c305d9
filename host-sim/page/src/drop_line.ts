// Drop line: from the tool straight down to the surface or the ground below it, with a ring where it ends. It shows
// where the tool is in depth.
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Group,
  Line,
  LineDashedMaterial,
  Mesh,
  MeshBasicMaterial,
  Quaternion,
  RingGeometry,
  Vector3,
} from "three";

import type { SurfaceHit } from "./bodies.ts";
import { colourOf } from "./colours.ts";

export const down = new Vector3(0, -1, 0);
const forward = new Vector3(0, 0, 1);
const lift = 0.02; // of the ring's radius: height above the surface

export class DropLine {
  readonly group = new Group();
  private readonly line: Line<BufferGeometry, LineDashedMaterial>;
  private readonly ring: Mesh<RingGeometry, MeshBasicMaterial>;

  constructor() {
    const ends = new BufferGeometry();
    ends.setAttribute("position", new BufferAttribute(new Float32Array(6), 3));
    this.line = new Line(ends, new LineDashedMaterial({ transparent: true, opacity: 0.7 }));
    this.line.frustumCulled = false;
    const paint = new MeshBasicMaterial({ side: DoubleSide, transparent: true, opacity: 0.6, depthWrite: false });
    this.ring = new Mesh(new RingGeometry(0.82, 1, 40), paint);
    this.ring.renderOrder = 1;
    this.group.add(this.line, this.ring);
    this.updateColours();
  }

  /** `radius`: m, of the ring. `hit`: the nearest surface below; null: none. `ground`: its height, m. */
  update(from: Vector3, radius: number, hit: SurfaceHit | null, ground: number | null): void {
    const onGround = ground !== null && from.y > ground && (!hit || hit.point.y < ground);
    const end = onGround ? new Vector3(from.x, ground, from.z) : (hit?.point ?? null);
    const normal = onGround || !hit ? new Vector3(0, 1, 0) : hit.normal;
    // Nothing to show of a tool that reaches the surface.
    this.group.visible = end !== null && from.distanceTo(end) > 0.9 * radius;
    if (!end || !this.group.visible) {
      return;
    }
    const position = this.line.geometry.getAttribute("position");
    position.setXYZ(0, from.x, from.y, from.z);
    position.setXYZ(1, end.x, end.y, end.z);
    position.needsUpdate = true;
    this.line.material.dashSize = 0.35 * radius;
    this.line.material.gapSize = 0.25 * radius;
    this.line.computeLineDistances();
    this.ring.position.copy(end).addScaledVector(normal, lift * radius);
    this.ring.quaternion.copy(new Quaternion().setFromUnitVectors(forward, normal));
    this.ring.scale.setScalar(radius);
  }

  updateColours(): void {
    this.line.material.color.set(colourOf("ink"));
    this.ring.material.color.set(colourOf("ink"));
  }

  dispose(): void {
    this.group.removeFromParent();
    this.line.geometry.dispose();
    this.line.material.dispose();
    this.ring.geometry.dispose();
    this.ring.material.dispose();
  }
}
