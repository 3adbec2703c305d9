// Region: the ellipsoid in which the device lets the grip move freely, as a wire ball of meridians and parallels.
import { BufferAttribute, BufferGeometry, LineBasicMaterial, LineSegments } from "three";

import { colourOf } from "./colours.ts";
import type { RegionInfo } from "./protocol.ts";

const meridians = 12;
const parallels = 7;
const pieces = 48; // of each circle

/** Ends of the segments of a unit ball's meridians and parallels. */
function unitBall(): Float32Array {
  const ends: number[] = [];
  const point = (latitude: number, longitude: number): void => {
    ends.push(Math.cos(latitude) * Math.cos(longitude), Math.sin(latitude), Math.cos(latitude) * Math.sin(longitude));
  };
  for (let k = 0; k < meridians; ++k) {
    const longitude = (2 * Math.PI * k) / meridians;
    for (let i = 0; i < pieces / 2; ++i) {
      point(Math.PI * ((2 * i) / pieces - 0.5), longitude);
      point(Math.PI * ((2 * (i + 1)) / pieces - 0.5), longitude);
    }
  }
  for (let k = 1; k <= parallels; ++k) {
    const latitude = Math.PI * (k / (parallels + 1) - 0.5);
    for (let i = 0; i < pieces; ++i) {
      point(latitude, (2 * Math.PI * i) / pieces);
      point(latitude, (2 * Math.PI * (i + 1)) / pieces);
    }
  }
  return Float32Array.from(ends);
}

export class Region {
  readonly lines: LineSegments<BufferGeometry, LineBasicMaterial>;
  private atEdge = false;
  private known = false;
  private wanted = true;

  constructor() {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(unitBall(), 3));
    this.lines = new LineSegments(geometry, new LineBasicMaterial({ transparent: true, depthWrite: false }));
    this.lines.frustumCulled = false;
    this.lines.visible = false;
    this.updateColours();
  }

  /** `atEdge`: the walls push the grip back. Returns whether anything has changed. */
  update(region: RegionInfo | null, atEdge: boolean): boolean {
    const before = [this.lines.visible, this.atEdge, ...this.lines.position.toArray(), ...this.lines.scale.toArray()];
    this.known = region !== null;
    this.lines.visible = this.known && this.wanted;
    this.atEdge = atEdge;
    if (region) {
      const [w, x, y, z] = region.orientation;
      this.lines.position.set(...region.centre);
      this.lines.scale.set(...region.semi_axes);
      this.lines.quaternion.set(x, y, z, w);
    }
    this.updateColours();
    const now = [this.lines.visible, this.atEdge, ...this.lines.position.toArray(), ...this.lines.scale.toArray()];
    return now.some((value, k) => value !== before[k]);
  }

  show(on: boolean): void {
    this.wanted = on;
    this.lines.visible = this.known && on;
  }

  updateColours(): void {
    this.lines.material.color.set(colourOf(this.atEdge ? "warn" : "first"));
    this.lines.material.opacity = this.atEdge ? 0.8 : 0.35;
  }
}
