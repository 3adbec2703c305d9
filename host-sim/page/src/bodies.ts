// Surfaces of the deformable bodies.
import {
  Box3,
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  DynamicDrawUsage,
  Group,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  type ColorRepresentation,
} from "three";

import type { Frame, Geometry, SceneMessage, Surface } from "./protocol.ts";

const colours = [0x3d7ea6, 0xd0814b, 0x6f9a5b, 0xb65f8a, 0x8a78c2, 0xc9a63c];

/** A surface with moving vertices. */
export class MovingSurface {
  readonly group = new Group();
  private readonly geometry = new BufferGeometry();
  private readonly solid: Mesh<BufferGeometry, MeshStandardMaterial>;
  private readonly wire: Mesh<BufferGeometry, MeshBasicMaterial>;
  private readonly box = new Box3();

  constructor(vertices: number, triangles: Uint32Array, colour: ColorRepresentation) {
    // Solid surface and wire frame share one geometry, whose vertices change every frame.
    this.geometry.setIndex(new BufferAttribute(triangles.slice(), 1));
    for (const name of ["position", "normal"]) {
      const attribute = new BufferAttribute(new Float32Array(3 * vertices), 3);
      attribute.setUsage(DynamicDrawUsage);
      this.geometry.setAttribute(name, attribute);
    }
    // Polygon offset, so that the wire frame lies on top of the surface.
    const paint = new MeshStandardMaterial({
      color: colour,
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
  }

  move(surface: Surface): void {
    const position = this.geometry.getAttribute("position") as BufferAttribute;
    const normal = this.geometry.getAttribute("normal") as BufferAttribute;
    (position.array as Float32Array).set(surface.positions);
    (normal.array as Float32Array).set(surface.normals);
    position.needsUpdate = true;
    normal.needsUpdate = true;
    this.box.setFromArray(surface.positions);
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

  constructor(scene: SceneMessage, geometry: Geometry) {
    this.surfaces = scene.bodies.map(
      (body, k) => new MovingSurface(body.vertices, geometry.triangles[k]!, colours[k % colours.length]!),
    );
    this.group.add(...this.surfaces.map((surface) => surface.group));
  }

  update(frame: Frame): void {
    for (const [body, surface] of frame.surfaces) {
      this.surfaces[body]?.move(surface);
    }
  }

  show(surfaces: boolean, wire: boolean, glass: boolean, ink: ColorRepresentation): void {
    for (const surface of this.surfaces) {
      surface.show(surfaces, wire, ink);
      surface.setGlass(glass);
    }
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
