// Viewport: camera, lights, ground and renderer.
import {
  Box3,
  Color,
  DirectionalLight,
  GridHelper,
  HemisphereLight,
  Mesh,
  NeutralToneMapping,
  PCFSoftShadowMap,
  PerspectiveCamera,
  PlaneGeometry,
  Scene,
  ShadowMaterial,
  Spherical,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

import { colourOf, isDark } from "./colours.ts";
import { roundScale } from "./round_scale.ts";

const fieldOfView = 40; // degrees, vertical
const defaultDirection = new Vector3(0.45, 0.4, 1).normalize();
const maxFrameTime = 50; // ms per frame; slower rendering reduces the quality
const qualityWindow = 12; // consecutive frames, over which the frame time is measured
const gridCells = 40;
const followMargin = 0.3; // fraction of half the view, within which a followed point may move freely
const followRate = 0.12; // fraction of the excess that is corrected per frame

export class Viewport {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(fieldOfView, 1, 0.001, 1000);
  readonly controls: OrbitControls;
  private readonly renderer: WebGLRenderer;
  private readonly sky = new HemisphereLight();
  private readonly sun = new DirectionalLight(0xffffff, 2.2);
  private readonly ground = new Mesh(new PlaneGeometry(1, 1), new ShadowMaterial({ opacity: 0.25 }));
  private grid: GridHelper | null = null;
  private groundHeight: number | null = null;
  private groundShown = true;
  private changed = true;
  private gridCell = 0.1; // m
  private consecutiveFrames = 0; // drawn one right after the other
  private firstFrameTime = 0; // ms, when the first of these was drawn
  private pixelRatio = Math.min(devicePixelRatio, 2);

  /** Throws where the browser has no WebGL. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFSoftShadowMap;
    // Shadows on the ground, which itself is invisible.
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.normalBias = 0.02;
    this.ground.rotation.x = -Math.PI / 2;
    this.ground.receiveShadow = true;
    this.ground.visible = false;
    this.scene.add(this.sky, this.sun, this.sun.target, this.ground);
    // Mouse control of the camera.
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.controls.dampingFactor = 0.15;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.invalidate());
    new ResizeObserver(() => this.resize()).observe(canvas);
    // After a lost WebGL context the renderer uploads its data again.
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.invalidate());
    this.updateColours();
    this.resize();
  }

  /** Requests a redraw. */
  invalidate(): void {
    this.changed = true;
  }

  /** Draws if anything has changed; returns whether it did. */
  draw(): boolean {
    this.controls.update();
    if (!this.changed) {
      this.consecutiveFrames = 0;
      return false;
    }
    this.changed = false;
    this.renderer.render(this.scene, this.camera);
    this.adaptQuality(performance.now());
    return true;
  }

  updateColours(): void {
    this.scene.background = new Color(colourOf("paper"));
    const dark = isDark();
    this.sky.color.set(0xffffff);
    this.sky.groundColor.set(dark ? 0x5a6066 : 0xb9b2a6);
    this.sky.intensity = dark ? 1.5 : 1.9;
    this.setGround(this.groundHeight);
    this.invalidate();
  }

  /** Height of the ground, m; null: the scene has none. */
  setGround(height: number | null): void {
    this.groundHeight = height;
    this.grid?.removeFromParent();
    this.grid?.dispose();
    this.grid = null;
    this.ground.visible = false;
    if (height === null || !this.groundShown) {
      return;
    }
    // Centre the grid on the view's target, aligned to its cells.
    const size = gridCells * this.gridCell;
    const line = new Color(colourOf("line"));
    this.grid = new GridHelper(size, gridCells, line, line);
    const centre = this.controls.target.clone().divideScalar(this.gridCell).round().multiplyScalar(this.gridCell);
    this.grid.position.set(centre.x, height, centre.z);
    this.ground.scale.set(size, size, 1);
    this.ground.position.set(centre.x, height - 0.002 * this.gridCell, centre.z);
    this.ground.visible = this.sun.castShadow;
    this.scene.add(this.grid);
    this.invalidate();
  }

  showGround(on: boolean): void {
    this.groundShown = on;
    this.setGround(this.groundHeight);
  }

  /** Centres the view on a box. `resetDirection`: also looks at it from the default direction. */
  frameBox(box: Box3, resetDirection: boolean): void {
    if (box.isEmpty()) {
      return;
    }
    const centre = box.getCenter(new Vector3());
    const radius = Math.max(0.5 * box.getSize(new Vector3()).length(), 1e-3);
    // Distance at which the sphere around the box fits the narrower field of view.
    const half = (fieldOfView * Math.PI) / 360;
    const across = Math.atan(Math.tan(half) * Math.min(1, this.camera.aspect));
    const distance = radius / Math.sin(across);
    const from = resetDirection
      ? defaultDirection.clone()
      : this.camera.position.clone().sub(this.controls.target).normalize();
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(from, distance);
    // Clip planes, zoom limits, lights and grid follow the size of the scene.
    this.camera.near = distance / 200;
    this.camera.far = distance * 50;
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = distance / 30;
    this.controls.maxDistance = distance * 10;
    this.placeLight(centre, radius);
    this.gridCell = roundScale(0.4 * radius);
    this.setGround(this.groundHeight);
    this.invalidate();
  }

  orbit(about: number, up: number): void {
    const away = this.camera.position.clone().sub(this.controls.target);
    const point = new Spherical().setFromVector3(away);
    point.theta -= about;
    point.phi = Math.min(Math.max(point.phi - up, 0.05), Math.PI - 0.05);
    this.camera.position.copy(this.controls.target).add(away.setFromSpherical(point));
    this.invalidate();
  }

  /** Moves the camera by fractions of the view's height. */
  pan(right: number, up: number): void {
    const move = this.screenOffset(this.controls.target, right, up);
    this.camera.position.add(move);
    this.controls.target.add(move);
    this.invalidate();
  }

  zoom(factor: number): void {
    const away = this.camera.position.clone().sub(this.controls.target);
    away.setLength(Math.min(Math.max(away.length() * factor, this.controls.minDistance), this.controls.maxDistance));
    this.camera.position.copy(this.controls.target).add(away);
    this.invalidate();
  }

  /** Displacement, m, of a point in the scene for fractions of the view's height to the right and up. */
  screenOffset(at: Vector3, right: number, up: number): Vector3 {
    const height = this.viewHeightAt(at);
    const x = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
    const y = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 1);
    return x.multiplyScalar(right * height).addScaledVector(y, up * height);
  }

  /** Height of the view, m, at the distance of a point. */
  viewHeightAt(at: Vector3): number {
    const depth = at.clone().sub(this.camera.position).dot(this.viewDirection());
    return 2 * Math.max(depth, this.camera.near) * Math.tan((fieldOfView * Math.PI) / 360);
  }

  /** Unit vector, into the image. */
  viewDirection(): Vector3 {
    return this.camera.getWorldDirection(new Vector3());
  }

  /** Moves the camera with a point to keep it near the middle of the view. */
  follow(at: Vector3): void {
    const point = at.clone().project(this.camera);
    const beyond = (part: number): number => Math.sign(part) * Math.max(0, Math.abs(part) - followMargin);
    const right = 0.5 * beyond(point.x) * this.camera.aspect;
    const up = 0.5 * beyond(point.y);
    if (Number.isFinite(right + up) && Math.abs(point.z) < 1 && Math.hypot(right, up) > 1e-3) {
      this.pan(followRate * right, followRate * up);
    }
  }

  /** CSS pixels from the canvas' upper left corner. */
  toScreen(at: Vector3): { x: number; y: number } {
    const point = at.clone().project(this.camera);
    return {
      x: ((point.x + 1) / 2) * this.canvas.clientWidth,
      y: ((1 - point.y) / 2) * this.canvas.clientHeight,
    };
  }

  private placeLight(centre: Vector3, radius: number): void {
    this.sun.position.copy(centre).add(new Vector3(0.6, 1.1, 1.1).multiplyScalar(2 * radius));
    this.sun.target.position.copy(centre);
    // The shadow camera covers the whole scene.
    const camera = this.sun.shadow.camera;
    const reach = 2 * radius;
    camera.left = camera.bottom = -reach;
    camera.right = camera.top = reach;
    camera.near = 0.1 * radius;
    camera.far = 10 * radius;
    camera.updateProjectionMatrix();
    this.sun.shadow.normalBias = 0.01 * radius;
  }

  private resize(): void {
    const width = Math.max(this.canvas.clientWidth, 1);
    const height = Math.max(this.canvas.clientHeight, 1);
    this.renderer.setPixelRatio(this.pixelRatio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }

  /** Reduces quality when frames take too long: first shadows, then the pixel ratio. */
  private adaptQuality(now: number): void {
    if (this.consecutiveFrames === 0) {
      this.firstFrameTime = now;
    }
    if (++this.consecutiveFrames <= qualityWindow) {
      return;
    }
    this.consecutiveFrames = 0;
    if ((now - this.firstFrameTime) / qualityWindow < maxFrameTime) {
      return;
    }
    if (this.sun.castShadow) {
      this.sun.castShadow = false;
      this.ground.visible = false;
    } else if (this.pixelRatio > 0.5) {
      this.pixelRatio = Math.max(0.5, 0.7 * this.pixelRatio);
      this.resize();
    }
  }
}
