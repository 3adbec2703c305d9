// Surfaces of the deformable bodies.
import {
  Box3,
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  DynamicDrawUsage,
  Group,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Raycaster,
  Sphere,
  Triangle,
  Vector3,
  type ColorRepresentation,
  type Ray,
} from "three";

import { addPressure, PressureScale } from "./pressure.ts";
import type { ContactForce, Frame, Geometry, SceneMessage, Surface, Triple } from "./protocol.ts";

const colours = [0x3d7ea6, 0xd0814b, 0x6f9a5b, 0xb65f8a, 0x8a78c2, 0xc9a63c];

/** Where a ray meets a surface. */
export interface SurfaceHit {
  body: number;
  triangle: number; // of the body
  weights: [number, number, number]; // barycentric, of the triangle's corners
  point: Vector3; // m
  normal: Vector3; // unit, toward the start of the ray
  distance: number; // m
}

/** A surface with moving vertices. */
export class MovingSurface {
  readonly group = new Group();
  private readonly geometry = new BufferGeometry();
  private readonly solid: Mesh<BufferGeometry, MeshStandardMaterial>;
  private readonly wire: Mesh<BufferGeometry, MeshBasicMaterial>;
  private readonly box = new Box3();
  private readonly base: Triple; // linear red, green and blue
  private readonly pressure: Float32Array; // Pa, per vertex
  private pressed = false;
  private painted = false; // in other colours than its own

  constructor(vertices: number, triangles: Uint32Array, colour: ColorRepresentation) {
    this.base = new Color(colour).toArray() as Triple;
    this.pressure = new Float32Array(vertices);
    // Solid surface and wire frame share one geometry, whose vertices change every frame.
    this.geometry.setIndex(new BufferAttribute(triangles.slice(), 1));
    for (const name of ["position", "normal"]) {
      const attribute = new BufferAttribute(new Float32Array(3 * vertices), 3);
      attribute.setUsage(DynamicDrawUsage);
      this.geometry.setAttribute(name, attribute);
    }
    const colours = new BufferAttribute(new Float32Array(3 * vertices), 3);
    colours.setUsage(DynamicDrawUsage);
    this.geometry.setAttribute("color", colours);
    // Polygon offset, so that the wire frame lies on top of the surface.
    const paint = new MeshStandardMaterial({
      vertexColors: true,
      roughness: 0.65,
      metalness: 0,
      side: DoubleSide,
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    this.solid = new Mesh(this.geometry, paint);
    this.solid.castShadow = true;
    this.solid.receiveShadow = true;
    this.solid.frustumCulled = false;
    this.wire = new Mesh(this.geometry, new MeshBasicMaterial({ wireframe: true, transparent: true, opacity: 0.55 }));
    this.wire.frustumCulled = false;
    this.group.add(this.solid, this.wire);
    this.paint(null);
  }

  /** Finds the pressure of contacts; returns the largest, Pa. `radius`: m, over which each force is spread. */
  press(contacts: ContactForce[], radius: number): number {
    const before = this.pressed;
    this.pressed = contacts.length > 0;
    if (!before && !this.pressed) {
      return 0;
    }
    this.pressure.fill(0);
    return addPressure(this.geometry.getAttribute("position").array as Float32Array, contacts, radius, this.pressure);
  }

  /** Colours the surface by the pressure; null: in its own colour. */
  paint(scale: PressureScale | null): void {
    if (scale && !this.pressed && !this.painted) {
      return;
    }
    const colours = this.geometry.getAttribute("color") as BufferAttribute;
    const array = colours.array as Float32Array;
    for (let i = 0; i < this.pressure.length; ++i) {
      array.set(scale && this.pressed ? scale.colour(this.pressure[i]!, this.base) : this.base, 3 * i);
    }
    this.painted = scale !== null && this.pressed;
    colours.needsUpdate = true;
  }

  move(surface: Surface): void {
    const position = this.geometry.getAttribute("position") as BufferAttribute;
    const normal = this.geometry.getAttribute("normal") as BufferAttribute;
    (position.array as Float32Array).set(surface.positions);
    (normal.array as Float32Array).set(surface.normals);
    position.needsUpdate = true;
    normal.needsUpdate = true;
    this.box.setFromArray(surface.positions);
    // Bounds for rays.
    this.geometry.boundingBox = this.box;
    this.geometry.boundingSphere = this.box.getBoundingSphere(this.geometry.boundingSphere ?? new Sphere());
  }

  /** The first hit of a ray; null: it misses. `from`: m, hits nearer than this are passed over. */
  hit(ray: Ray, from: number): Omit<SurfaceHit, "body"> | null {
    const caster = new Raycaster(ray.origin, ray.direction, from);
    const [found] = caster.intersectObject(this.solid, false);
    if (!found?.face) {
      return null;
    }
    const [a, b, c] = this.cornersOf(found.faceIndex!);
    const weights = new Vector3();
    new Triangle(a, b, c).getBarycoord(found.point, weights);
    const normal = found.face.normal.clone();
    if (normal.dot(ray.direction) > 0) {
      normal.negate();
    }
    return {
      triangle: found.faceIndex!,
      weights: weights.toArray(),
      point: found.point,
      normal,
      distance: found.distance,
    };
  }

  /** m, a point fixed to a triangle by its barycentric weights. */
  pointOn(triangle: number, weights: [number, number, number]): Vector3 {
    const point = new Vector3();
    this.cornersOf(triangle).forEach((corner, k) => point.addScaledVector(corner, weights[k]!));
    return point;
  }

  private cornersOf(triangle: number): [Vector3, Vector3, Vector3] {
    const position = this.geometry.getAttribute("position") as BufferAttribute;
    const corner = (k: number): Vector3 =>
      new Vector3().fromBufferAttribute(position, this.geometry.index!.getX(3 * triangle + k));
    return [corner(0), corner(1), corner(2)];
  }

  show(surface: boolean, wire: boolean, ink: ColorRepresentation): void {
    this.solid.visible = surface;
    this.wire.visible = wire;
    this.wire.material.color.set(ink);
  }

  /** Makes the surface transparent, to show what is inside. */
  setGlass(on: boolean): void {
    const paint = this.solid.material;
    if (paint.transparent !== on) {
      paint.transparent = on;
      paint.opacity = on ? 0.35 : 1;
      paint.depthWrite = !on;
      paint.needsUpdate = true;
    }
  }

  extent(): Box3 {
    return this.box;
  }

  dispose(): void {
    this.group.removeFromParent();
    this.geometry.dispose();
    this.solid.material.dispose();
    this.wire.material.dispose();
  }
}

export class Bodies {
  readonly group = new Group();
  private readonly surfaces: MovingSurface[];
  private readonly pressureScale = new PressureScale();
  private readonly maskRadius: number; // m
  private showsPressure = false;
  private paintedBefore = false;

  constructor(scene: SceneMessage, geometry: Geometry) {
    this.maskRadius = scene.mask_radius;
    this.surfaces = scene.bodies.map(
      (body, k) => new MovingSurface(body.vertices, geometry.triangles[k]!, colours[k % colours.length]!),
    );
    this.group.add(...this.surfaces.map((surface) => surface.group));
  }

  /** `pressure`: whether the surfaces show the pressure of the contacts. */
  update(frame: Frame, pressure: boolean): void {
    for (const [body, surface] of frame.surfaces) {
      this.surfaces[body]?.move(surface);
    }
    if (pressure) {
      const radius = Math.max(this.maskRadius, frame.proxies?.radii[0] ?? 0, 1e-6);
      const largest = this.surfaces.map((surface, body) =>
        surface.press(
          frame.contacts.filter((contact) => contact.body === body),
          radius,
        ),
      );
      this.pressureScale.include(Math.max(0, ...largest));
    }
    this.showsPressure = pressure && frame.contacts.length > 0;
    if (pressure || this.paintedBefore) {
      this.surfaces.forEach((surface) => surface.paint(pressure ? this.pressureScale : null));
    }
    this.paintedBefore = pressure;
  }

  /** Pa, of the last colour; 0: no pressure is shown. */
  pressureTop(): number {
    return this.showsPressure ? this.pressureScale.top : 0;
  }

  show(surfaces: boolean, wire: boolean, glass: boolean, ink: ColorRepresentation): void {
    for (const surface of this.surfaces) {
      surface.show(surfaces, wire, ink);
      surface.setGlass(glass);
    }
  }

  /** The first hit of a ray on any body; null: it misses all. `from`: m, hits nearer than this are passed over. */
  hit(ray: Ray, from = 0): SurfaceHit | null {
    let nearest: SurfaceHit | null = null;
    this.surfaces.forEach((surface, body) => {
      const found = surface.hit(ray, from);
      if (found && (!nearest || found.distance < nearest.distance)) {
        nearest = { body, ...found };
      }
    });
    return nearest;
  }

  /** m, a point fixed to the surface of a body. */
  pointOn(hit: Pick<SurfaceHit, "body" | "triangle" | "weights">): Vector3 {
    return this.surfaces[hit.body]!.pointOn(hit.triangle, hit.weights);
  }

  extents(): Box3[] {
    return this.surfaces.map((surface) => surface.extent());
  }

  dispose(): void {
    this.group.removeFromParent();
    for (const surface of this.surfaces) {
      surface.dispose();
    }
  }
}
