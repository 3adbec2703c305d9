// Overlays of the particle model: particles, their ellipsoids, groups and links.
import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  Group,
  InstancedMesh,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  MeshStandardMaterial,
  Points,
  PointsMaterial,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";

import { colourOf } from "./colours.ts";
import type { ViewOptions } from "./options.ts";
import type { Frame, Geometry, SceneMessage } from "./protocol.ts";

const pointSize = 5; // pixels

/** Lines between particles, which follow them. */
class ParticleLines {
  readonly lines: LineSegments<BufferGeometry, LineBasicMaterial>;

  constructor(private readonly ends: Uint32Array) {
    const geometry = new BufferGeometry();
    const position = new BufferAttribute(new Float32Array(3 * ends.length), 3);
    position.setUsage(DynamicDrawUsage);
    geometry.setAttribute("position", position);
    this.lines = new LineSegments(geometry, new LineBasicMaterial({ transparent: true, opacity: 0.6 }));
    this.lines.frustumCulled = false;
  }

  move(particles: Float32Array): void {
    const position = this.lines.geometry.getAttribute("position") as BufferAttribute;
    const array = position.array as Float32Array;
    this.ends.forEach((particle, i) => {
      array[3 * i] = particles[3 * particle]!;
      array[3 * i + 1] = particles[3 * particle + 1]!;
      array[3 * i + 2] = particles[3 * particle + 2]!;
    });
    position.needsUpdate = true;
  }

  dispose(): void {
    this.lines.geometry.dispose();
    this.lines.material.dispose();
  }
}

/** From each group's centre to its members. */
function spokes(geometry: Geometry): Uint32Array {
  const ends: number[] = [];
  for (const { centre, members } of geometry.groups) {
    for (const member of members) {
      if (member !== centre) {
        ends.push(centre, member);
      }
    }
  }
  return Uint32Array.from(ends);
}

export class Overlays {
  readonly group = new Group();
  private readonly positions: Float32Array; // m, of all particles
  private readonly orientations: Float32Array;
  private readonly points: Points<BufferGeometry, PointsMaterial>;
  private readonly ellipsoids: InstancedMesh<SphereGeometry, MeshStandardMaterial>;
  private readonly groups: ParticleLines;
  private readonly links: ParticleLines;

  constructor(
    private readonly scene: SceneMessage,
    private readonly geometry: Geometry,
  ) {
    const count = geometry.semiAxes.length / 3;
    this.positions = new Float32Array(3 * count);
    this.orientations = new Float32Array(4 * count);
    // Particles as points of constant size, drawn over everything.
    const cloud = new BufferGeometry();
    const position = new BufferAttribute(this.positions, 3);
    position.setUsage(DynamicDrawUsage);
    cloud.setAttribute("position", position);
    this.points = new Points(cloud, new PointsMaterial({ size: pointSize, sizeAttenuation: false, depthTest: false }));
    this.points.frustumCulled = false;
    this.points.renderOrder = 2;
    // One instance of a sphere per ellipsoid.
    this.ellipsoids = new InstancedMesh(
      new SphereGeometry(1, 16, 12),
      new MeshStandardMaterial({ transparent: true, opacity: 0.45, roughness: 0.6, depthWrite: false }),
      count,
    );
    this.ellipsoids.frustumCulled = false;
    // Groups as spokes from the centre, links as lines.
    this.groups = new ParticleLines(spokes(geometry));
    this.links = new ParticleLines(geometry.links);
    this.group.add(this.points, this.ellipsoids, this.groups.lines, this.links.lines);
    this.updateColours();
  }

  /** Whether any overlay is shown, so that particles must be streamed. */
  static wanted(options: ViewOptions): boolean {
    return options.particles || options.ellipsoids || options.groups || options.links;
  }

  update(frame: Frame): void {
    if (frame.particles.size === 0) {
      return;
    }
    // Copy the moved bodies' particles into the arrays of all particles.
    for (const [body, moved] of frame.particles) {
      const first = this.scene.bodies[body]?.first_particle ?? 0;
      this.positions.set(moved.positions, 3 * first);
      this.orientations.set(moved.orientations, 4 * first);
    }
    this.points.geometry.getAttribute("position").needsUpdate = true;
    // Update only the visible overlays.
    if (this.ellipsoids.visible) {
      this.updateEllipsoids();
    }
    if (this.groups.lines.visible) {
      this.groups.move(this.positions);
    }
    if (this.links.lines.visible) {
      this.links.move(this.positions);
    }
  }

  /** m, of a particle, from the last frame that included it. */
  positionOf(index: number): Vector3 {
    return new Vector3().fromArray(this.positions, 3 * index);
  }

  show(options: ViewOptions): void {
    this.points.visible = options.particles;
    this.ellipsoids.visible = options.ellipsoids;
    this.groups.lines.visible = options.groups;
    this.links.lines.visible = options.links;
  }

  updateColours(): void {
    this.points.material.color.set(colourOf("ink"));
    this.ellipsoids.material.color.set(colourOf("fourth"));
    this.groups.lines.material.color.set(colourOf("third"));
    this.links.lines.material.color.set(colourOf("second"));
  }

  dispose(): void {
    this.group.removeFromParent();
    this.points.geometry.dispose();
    this.points.material.dispose();
    this.ellipsoids.geometry.dispose();
    this.ellipsoids.material.dispose();
    this.ellipsoids.dispose();
    this.groups.dispose();
    this.links.dispose();
  }

  private updateEllipsoids(): void {
    const matrix = new Matrix4();
    const axes = new Quaternion();
    const orientation = new Quaternion();
    for (let i = 0; i < this.ellipsoids.count; ++i) {
      // world_from_ellipsoid = world_from_particle * particle_from_ellipsoid
      orientation.fromArray(this.orientations, 4 * i).multiply(axes.fromArray(this.geometry.ellipsoidAxes, 4 * i));
      matrix.compose(
        new Vector3().fromArray(this.positions, 3 * i),
        orientation,
        new Vector3().fromArray(this.geometry.semiAxes, 3 * i),
      );
      this.ellipsoids.setMatrixAt(i, matrix);
    }
    this.ellipsoids.instanceMatrix.needsUpdate = true;
  }
}
