// Tool: its surface and spheres, the device's pose, force and torque arrows, and contact planes.
import {
  ArrowHelper,
  Box3,
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  Color,
  DoubleSide,
  Group,
  InstancedMesh,
  Line,
  LineBasicMaterial,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Quaternion,
  Sphere,
  SphereGeometry,
  Vector3,
  type Ray,
} from "three";

import { MovingSurface } from "./bodies.ts";
import { colourOf } from "./colours.ts";
import type { ViewOptions } from "./options.ts";
import type { Frame, Geometry, Hand, Plane, Proxies, SceneMessage } from "./protocol.ts";
import { roundScale } from "./round_scale.ts";

const skin = 0xdea480;
const maxPlanes = 192;
const forward = new Vector3(0, 0, 1);

/** An arrow with a round scale that keeps it well within the view. */
class ScaledArrow {
  readonly arrow = new ArrowHelper(forward, new Vector3(), 1);
  private recentMax = 0; // decaying maximum of the magnitude
  scale = 0; // m per unit

  constructor() {
    this.arrow.renderOrder = 3;
    for (const part of [this.arrow.line, this.arrow.cone]) {
      const paint = part.material as LineBasicMaterial | MeshBasicMaterial;
      paint.depthTest = false;
      paint.transparent = true;
    }
  }

  /** `maxLength`: m, of the longest arrow. */
  point(from: Vector3, what: Vector3, maxLength: number, shown: boolean): void {
    const size = what.length();
    this.recentMax = Math.max(size, 0.998 * this.recentMax);
    this.arrow.visible = shown && size > 1e-3 * Math.max(this.recentMax, 1e-6) && size > 1e-9;
    if (!this.arrow.visible) {
      return;
    }
    this.scale = roundScale(maxLength / this.recentMax);
    const length = size * this.scale;
    this.arrow.position.copy(from);
    this.arrow.setDirection(what.clone().divideScalar(size));
    this.arrow.setLength(length, Math.min(0.3 * length, 0.12 * maxLength), Math.min(0.18 * length, 0.07 * maxLength));
  }

  dispose(): void {
    this.arrow.removeFromParent();
    this.arrow.dispose();
  }
}

export class Tool {
  readonly group = new Group();
  private readonly surface: MovingSurface | null;
  private readonly spheres: InstancedMesh<SphereGeometry, MeshStandardMaterial>;
  private readonly hip: Mesh<SphereGeometry, MeshBasicMaterial>;
  private readonly spring: Line<BufferGeometry, LineBasicMaterial>;
  private readonly planes: InstancedMesh<CircleGeometry, MeshBasicMaterial>;
  private readonly force = new ScaledArrow();
  private readonly torque = new ScaledArrow();
  private readonly touching = new Color();
  private readonly free = new Color();
  private proxies: Proxies | null = null;
  private readonly origin = new Vector3(); // m

  constructor(scene: SceneMessage, geometry: Geometry) {
    // The skin, if the tool has a mesh.
    this.surface =
      scene.tool.triangles > 0 ? new MovingSurface(scene.tool.vertices, geometry.toolTriangles, skin) : null;
    this.spheres = new InstancedMesh(
      new SphereGeometry(1, 32, 24),
      new MeshStandardMaterial({ roughness: 0.45 }),
      Math.max(scene.tool.radii.length, 1),
    );
    this.spheres.frustumCulled = false;
    this.spheres.castShadow = true;
    // The hip's mark and the coupling's line.
    this.hip = new Mesh(
      new SphereGeometry(1, 24, 16),
      new MeshBasicMaterial({ transparent: true, opacity: 0.3, depthWrite: false }),
    );
    const ends = new BufferGeometry();
    ends.setAttribute("position", new BufferAttribute(new Float32Array(6), 3));
    this.spring = new Line(ends, new LineBasicMaterial({ depthTest: false, transparent: true }));
    this.spring.frustumCulled = false;
    this.spring.renderOrder = 3;
    // Contact planes as transparent discs.
    this.planes = new InstancedMesh(
      new CircleGeometry(1, 24),
      new MeshBasicMaterial({ side: DoubleSide, transparent: true, opacity: 0.45, depthWrite: false }),
      maxPlanes,
    );
    this.planes.frustumCulled = false;
    this.planes.count = 0;
    this.group.add(this.spheres, this.hip, this.spring, this.planes, this.force.arrow, this.torque.arrow);
    if (this.surface) {
      this.group.add(this.surface.group);
    }
    this.updateColours();
  }

  update(frame: Frame, options: ViewOptions, viewHeight: number): void {
    if (frame.toolSurface) {
      this.surface?.move(frame.toolSurface);
    }
    if (frame.proxies) {
      this.proxies = frame.proxies;
      this.updateSpheres(frame.proxies);
    }
    if (frame.hand) {
      this.updateHand(frame.hand, options, viewHeight);
    }
    this.updatePlanes(options.planes ? (frame.planes ?? []) : []);
  }

  show(options: ViewOptions, ink: string): void {
    this.surface?.show(options.surfaces, options.wireframe, ink);
    this.surface?.setGlass(options.proxies);
    this.spheres.visible = !this.surface || options.proxies || !(options.surfaces || options.wireframe);
    if (!options.arrows) {
      this.force.arrow.visible = this.torque.arrow.visible = false;
    }
  }

  /** Bounds of the spheres and of their goals. */
  extent(): Box3 {
    const box = new Box3();
    const proxies = this.proxies;
    for (let i = 0; i < (proxies?.count ?? 0); ++i) {
      for (const points of [proxies!.positions, proxies!.goals]) {
        const centre = new Vector3().fromArray(points, 3 * i);
        box.union(new Box3(centre.clone(), centre.clone()).expandByScalar(proxies!.radii[i]!));
      }
    }
    return box;
  }

  /** m, of the tool's origin. */
  position(): Vector3 {
    return this.origin.clone();
  }

  /** m, along a ray to the tool's skin, or to its spheres if it has none; Infinity: the ray misses. */
  hitDistance(ray: Ray): number {
    if (this.surface) {
      return this.surface.hit(ray, 0)?.distance ?? Infinity;
    }
    let nearest = Infinity;
    for (let i = 0; i < (this.proxies?.count ?? 0); ++i) {
      const centre = new Vector3().fromArray(this.proxies!.positions, 3 * i);
      const at = ray.intersectSphere(new Sphere(centre, this.proxies!.radii[i]!), new Vector3());
      nearest = Math.min(nearest, at?.distanceTo(ray.origin) ?? Infinity);
    }
    return nearest;
  }

  /** m, of the ring below the tool: that of a single sphere, otherwise a quarter of its longest horizontal side. */
  footprint(): number {
    const size = this.extent().getSize(new Vector3());
    return this.proxies?.count === 1 ? this.proxies.radii[0]! : Math.max(0.25 * Math.max(size.x, size.z), 1e-4);
  }

  /** Lengths of one unit of force and torque, m; 0: no arrow is drawn. */
  scales(): { force: number; torque: number } {
    return {
      force: this.force.arrow.visible ? this.force.scale : 0,
      torque: this.torque.arrow.visible ? this.torque.scale : 0,
    };
  }

  updateColours(): void {
    this.touching.set(colourOf("second"));
    this.free.set(colourOf("fourth"));
    this.hip.material.color.set(colourOf("ink"));
    this.spring.material.color.set(colourOf("ink"));
    this.planes.material.color.set(colourOf("third"));
    this.force.arrow.setColor(colourOf("warn"));
    this.torque.arrow.setColor(colourOf("first"));
    if (this.proxies) {
      this.updateSpheres(this.proxies);
    }
  }

  dispose(): void {
    this.group.removeFromParent();
    this.surface?.dispose();
    for (const part of [this.spheres, this.hip, this.spring, this.planes]) {
      part.geometry.dispose();
      part.material.dispose();
    }
    this.spheres.dispose();
    this.planes.dispose();
    this.force.dispose();
    this.torque.dispose();
  }

  private updateSpheres(proxies: Proxies): void {
    const matrix = new Matrix4();
    this.spheres.count = Math.min(proxies.count, this.spheres.instanceMatrix.count);
    for (let i = 0; i < this.spheres.count; ++i) {
      const radius = proxies.radii[i]!;
      matrix.compose(
        new Vector3().fromArray(proxies.positions, 3 * i),
        new Quaternion(),
        new Vector3(radius, radius, radius),
      );
      this.spheres.setMatrixAt(i, matrix);
      this.spheres.setColorAt(i, proxies.touches[i] ? this.touching : this.free);
    }
    this.spheres.instanceMatrix.needsUpdate = true;
    if (this.spheres.instanceColor) {
      this.spheres.instanceColor.needsUpdate = true;
    }
  }

  /** Radius of the hip's mark: that of a single sphere, otherwise smaller. */
  private markRadius(): number {
    const proxies = this.proxies;
    return !proxies || proxies.count === 0 ? 0.01 : proxies.count === 1 ? proxies.radii[0]! : 0.5 * proxies.radii[0]!;
  }

  private updateHand(hand: Hand, options: ViewOptions, viewHeight: number): void {
    const tool = this.origin.set(...hand.tool);
    const hip = new Vector3(...hand.hip);
    const radius = this.markRadius();
    // Mark of the hip, and the coupling as a line from the tool to it.
    this.hip.position.copy(hip);
    this.hip.scale.setScalar(radius);
    this.hip.visible = hip.distanceTo(tool) > 0.02 * radius;
    this.spring.visible = this.hip.visible;
    const ends = this.spring.geometry.getAttribute("position");
    // Line from tool to hip.
    ends.setXYZ(0, tool.x, tool.y, tool.z);
    ends.setXYZ(1, hip.x, hip.y, hip.z);
    ends.needsUpdate = true;
    // Wrench on the tool, in the scene.
    const maxLength = 0.3 * viewHeight;
    this.force.point(tool, new Vector3(...hand.force), maxLength, options.arrows);
    this.torque.point(tool, new Vector3(...hand.torque), 0.6 * maxLength, options.arrows);
  }

  /**
   * Discs on the contact planes. A plane's offset applies to the proxy's centre, so the surface is one radius nearer.
   */
  private updatePlanes(planes: Plane[]): void {
    const proxies = this.proxies;
    const matrix = new Matrix4();
    this.planes.count = 0;
    for (const plane of planes) {
      if (!proxies || plane.proxy >= proxies.count || this.planes.count >= maxPlanes) {
        continue;
      }
      // Project the proxy's centre onto the surface; larger discs for touched planes.
      const normal = new Vector3(...plane.normal);
      const centre = new Vector3().fromArray(proxies.positions, 3 * plane.proxy);
      const radius = proxies.radii[plane.proxy]!;
      centre.addScaledVector(normal, plane.offset - normal.dot(centre) - radius);
      const size = (plane.touches ? 1.5 : 0.8) * radius;
      matrix.compose(centre, new Quaternion().setFromUnitVectors(forward, normal), new Vector3(size, size, size));
      this.planes.setMatrixAt(this.planes.count++, matrix);
    }
    this.planes.instanceMatrix.needsUpdate = true;
  }
}
