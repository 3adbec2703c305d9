// Ground: a grid that reaches to the horizon, and the shadows on it.
import { Color, Mesh, PlaneGeometry, ShaderMaterial, ShadowMaterial, type Group, type Vector3 } from "three";

import { colourOf } from "./colours.ts";

const cellsAcross = 400;
const majorCells = 10; // every tenth line is stronger

// Lines of constant width on the screen. A direction whose lines would merge fades, without taking the other along.
const fragmentShader = `
uniform vec3 colour;
uniform float cell;
uniform float reach;
varying vec2 at;
float lines(float spacing, float width) {
  vec2 q = at / spacing;
  vec2 pixel = max(fwidth(q), vec2(1e-6));
  vec2 away = abs(fract(q - 0.5) - 0.5) / pixel;
  vec2 covered = clamp(0.5 * width + 0.5 - away, 0.0, 1.0) * (1.0 - smoothstep(0.2, 0.6, pixel));
  return max(covered.x, covered.y);
}
void main() {
  float shade = max(0.45 * lines(cell, 1.0), 0.85 * lines(${majorCells.toFixed(1)} * cell, 1.3));
  shade *= 1.0 - smoothstep(0.05, 0.6, length(at) / reach);
  if (shade < 0.01) discard;
  gl_FragColor = vec4(colour, shade);
  #include <colorspace_fragment>
}`;
const vertexShader = `
varying vec2 at;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  at = (world - modelMatrix * vec4(0.0, 0.0, 0.0, 1.0)).xz;
  gl_Position = projectionMatrix * viewMatrix * world;
}`;

export class Ground {
  private readonly grid: Mesh<PlaneGeometry, ShaderMaterial>;
  private readonly shadow: Mesh<PlaneGeometry, ShadowMaterial>;
  private height: number | null = null; // m
  private cell = 0.1; // m
  private shown = true;
  private shadows = true;

  constructor(group: Group) {
    const uniforms = { colour: { value: new Color() }, cell: { value: 0.1 }, reach: { value: 1 } };
    const lines = new ShaderMaterial({ uniforms, vertexShader, fragmentShader, transparent: true, depthWrite: false });
    lines.side = 2;
    this.grid = new Mesh(new PlaneGeometry(1, 1), lines);
    this.shadow = new Mesh(new PlaneGeometry(1, 1), new ShadowMaterial({ opacity: 0.25, depthWrite: false }));
    this.shadow.receiveShadow = true;
    this.shadow.renderOrder = -2;
    this.grid.renderOrder = -1;
    for (const plane of [this.shadow, this.grid]) {
      plane.rotation.x = -Math.PI / 2;
      plane.frustumCulled = false;
      group.add(plane);
    }
    this.updateColours();
    this.apply();
  }

  /** Lowest height, m, that the camera may have; null: any. */
  get limit(): number | null {
    return this.shown ? this.height : null;
  }
  /** m; null: the scene has no ground. */
  get level(): number | null {
    return this.height;
  }
  get cellSize(): number {
    return this.cell;
  }

  setHeight(height: number | null): void {
    this.height = height;
    this.apply();
  }
  setCell(cell: number): void {
    this.cell = cell;
    this.apply();
  }
  show(on: boolean): void {
    this.shown = on;
    this.apply();
  }
  showShadows(on: boolean): void {
    this.shadows = on;
    this.apply();
  }

  /** Keeps the grid below the middle of the view; its lines stay in place. */
  follow(middle: Vector3): void {
    const tile = majorCells * this.cell;
    const [x, z] = [middle.x, middle.z].map((part) => tile * Math.round(part / tile)) as [number, number];
    this.grid.position.set(x, this.height ?? 0, z);
    this.shadow.position.set(x, (this.height ?? 0) - 0.002 * this.cell, z);
  }

  updateColours(): void {
    (this.grid.material.uniforms["colour"]!.value as Color).set(colourOf("grid"));
  }

  private apply(): void {
    const size = cellsAcross * this.cell;
    this.grid.scale.set(size, size, 1);
    this.shadow.scale.set(size, size, 1);
    this.grid.material.uniforms["cell"]!.value = this.cell;
    this.grid.material.uniforms["reach"]!.value = 0.5 * size;
    this.grid.visible = this.shown && this.height !== null;
    this.shadow.visible = this.grid.visible && this.shadows;
  }
}
