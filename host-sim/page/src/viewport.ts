// Viewport: camera, lights, ground, marks of scale, and renderer.
import {
  Box3,
  Color,
  DirectionalLight,
  Group,
  HemisphereLight,
  NeutralToneMapping,
  PCFSoftShadowMap,
  PerspectiveCamera,
  Scene,
  Spherical,
  Vector3,
  WebGLRenderer,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

import { colourOf, isDark } from "./colours.ts";
import type { Area } from "./free_area.ts";
import { Ground } from "./ground.ts";
import { roundScale } from "./round_scale.ts";
import { drawMarks } from "./scale_marks.ts";

const fieldOfView = 40; // degrees, vertical
const defaultDirection = new Vector3(0.45, 0.4, 1).normalize();
const maxFrameTime = 50; // ms per frame; slower rendering reduces the quality
const qualityWindow = 12; // consecutive frames, over which the frame time is measured
// Fractions of half the free area, within which a followed point may move freely.
const followMargin = { across: 0.3, upright: 0.12 };
const followTime = 130; // ms, in which the excess decays to 1/e
const margin = 0.86; // fraction of the free area that a framed box takes
const aboveGround = 0.01; // of its distance to the target: the camera's least height above the ground

export class Viewport {
  readonly scene = new Scene();
  readonly camera = new PerspectiveCamera(fieldOfView, 1, 0.001, 1000);
  readonly controls: OrbitControls;
  private readonly renderer: WebGLRenderer;
  private readonly sky = new HemisphereLight();
  private readonly sun = new DirectionalLight(0xffffff, 2.2);
  private readonly groundGroup = new Group();
  private readonly ground: Ground;
  private changed = true;
  private area: Area = { left: 0, top: 0, width: 1, height: 1 };
  private drawnAt = 0; // ms
  /** Length of the scale bar, m. */
  bar = 0;
  private consecutiveFrames = 0; // drawn one right after the other
  private firstFrameTime = 0; // ms, when the first of these was drawn
  private pixelRatio = Math.min(devicePixelRatio, 2);

  /** Throws where the browser has no WebGL. */
  constructor(
    readonly canvas: HTMLCanvasElement,
    readonly marks: HTMLCanvasElement,
    private readonly measureArea: () => Area,
  ) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFSoftShadowMap;
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.normalBias = 0.02;
    this.ground = new Ground(this.groundGroup);
    this.scene.add(this.sky, this.sun, this.sun.target, this.groundGroup);
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
    this.stayAboveGround();
    if (!this.changed) {
      this.consecutiveFrames = 0;
      return false;
    }
    this.changed = false;
    this.render();
    this.adaptQuality(performance.now());
    return true;
  }

  /** Draws the scene now, into a buffer that is valid until the current task ends. */
  render(): void {
    this.ground.follow(this.controls.target);
    this.renderer.render(this.scene, this.camera);
    this.drawMarks();
  }

  /** Draws like render(), at the screen's full resolution even where drawing it is slow. */
  renderSharp(): void {
    const ratio = this.pixelRatio;
    this.pixelRatio = devicePixelRatio;
    this.resize();
    this.render();
    this.pixelRatio = ratio;
  }
  /** After renderSharp() and reading its picture. */
  endSharp(): void {
    this.resize();
  }

  /** Size of the view, pixels of the screen. */
  get screenSize(): { width: number; height: number } {
    const { clientWidth, clientHeight } = this.canvas;
    return { width: Math.round(devicePixelRatio * clientWidth), height: Math.round(devicePixelRatio * clientHeight) };
  }

  private drawMarks(): void {
    const context = this.marks.getContext("2d");
    if (!context) {
      return;
    }
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const ratio = devicePixelRatio;
    this.marks.width = Math.max(1, Math.round(ratio * width));
    this.marks.height = Math.max(1, Math.round(ratio * height));
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    const fontSize = 0.8 * parseFloat(getComputedStyle(document.documentElement).fontSize);
    const metresPerPixel = this.viewHeightAt(this.controls.target) / Math.max(height, 1);
    this.bar = drawMarks(context, this.camera, this.area, metresPerPixel, { colourOf, fontSize });
  }

  updateColours(): void {
    this.scene.background = new Color(colourOf("paper"));
    const dark = isDark();
    this.sky.color.set(0xffffff);
    this.sky.groundColor.set(dark ? 0x5a6066 : 0xb9b2a6);
    this.sky.intensity = dark ? 1.5 : 1.9;
    this.ground.updateColours();
    this.invalidate();
  }

  /** Height of the ground, m; null: the scene has none. */
  setGround(height: number | null): void {
    this.ground.setHeight(height);
    this.invalidate();
  }

  /** Without the ground the camera may look from below. */
  showGround(on: boolean): void {
    this.ground.show(on);
    this.invalidate();
  }

  /** Height of the ground, m; null: the scene has none. */
  get groundLevel(): number | null {
    return this.ground.level;
  }

  /** Centres the view on a box. `resetDirection`: also looks at it from the default direction. */
  frameBox(box: Box3, resetDirection: boolean): void {
    if (box.isEmpty()) {
      return;
    }
    const centre = box.getCenter(new Vector3());
    const radius = Math.max(0.5 * box.getSize(new Vector3()).length(), 1e-3);
    const from = resetDirection
      ? defaultDirection.clone()
      : this.camera.position.clone().sub(this.controls.target).normalize();
    const distance = this.fittingDistance(box, centre, from, radius);
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(from, distance);
    // Clip planes, zoom limits, lights and grid follow the size of the scene.
    this.camera.near = distance / 200;
    this.camera.far = distance * 50;
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = distance / 30;
    this.controls.maxDistance = distance * 10;
    this.placeLight(centre, radius);
    this.ground.setCell(roundScale(0.4 * radius));
    this.controls.update(); // turns the camera to its target
    this.invalidate();
  }

  /** Distance from which all corners of a box lie within the free area, the view's target being its centre. */
  private fittingDistance(box: Box3, centre: Vector3, from: Vector3, radius: number): number {
    const right = new Vector3(0, 1, 0).cross(from).normalize();
    const up = from.clone().cross(right);
    // Tangents of half the fields of view of the free area.
    const tall = Math.tan((fieldOfView * Math.PI) / 360) * margin;
    const height = Math.max(this.canvas.clientHeight, 1);
    const upward = (tall * this.area.height) / height;
    const sideways = (tall * this.area.width) / height;
    let distance = 1.1 * radius; // outside the box
    for (let k = 0; k < 8; ++k) {
      const corner = new Vector3(
        k & 1 ? box.max.x : box.min.x,
        k & 2 ? box.max.y : box.min.y,
        k & 4 ? box.max.z : box.min.z,
      ).sub(centre);
      const across = Math.max(Math.abs(corner.dot(right)) / sideways, Math.abs(corner.dot(up)) / upward);
      distance = Math.max(distance, corner.dot(from) + across);
    }
    return distance;
  }

  /** Where the canvas is free or covered has changed. */
  updateArea(): void {
    const area = this.measureArea();
    const same = area.top === this.area.top && area.height === this.area.height && area.width === this.area.width;
    if (!same) {
      this.area = area;
      this.applyArea();
    }
  }

  /** Shifts the image, so that the camera's target is in the middle of the free area. */
  private applyArea(): void {
    const width = Math.max(this.canvas.clientWidth, 1);
    const height = Math.max(this.canvas.clientHeight, 1);
    const right = width / 2 - (this.area.left + this.area.width / 2);
    const down = height / 2 - (this.area.top + this.area.height / 2);
    this.camera.setViewOffset(width, height, right, down, width, height);
    this.invalidate();
  }

  /** Keeps target and camera above the ground, if it is shown: shifts both, then limits the camera's polar angle. */
  private stayAboveGround(): void {
    const limit = this.ground.limit;
    if (limit === null) {
      return;
    }
    const { target } = this.controls;
    const sunk = limit - target.y;
    if (sunk > 0) {
      target.y += sunk;
      this.camera.position.y += sunk;
    }
    const away = this.camera.position.clone().sub(target);
    const least = limit + aboveGround * away.length() - target.y;
    if (away.y < least - 1e-6 * away.length()) {
      const point = new Spherical().setFromVector3(away);
      point.phi = Math.acos(Math.min(least / point.radius, 1));
      this.camera.position.copy(target).add(away.setFromSpherical(point));
      this.camera.lookAt(target);
      this.invalidate();
    }
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

  /** Moves the camera with a point to keep it near the middle of the free area. */
  follow(at: Vector3): void {
    const now = performance.now();
    const rate = 1 - Math.exp(-Math.min(now - this.drawnAt, 500) / followTime);
    this.drawnAt = now;
    // Excess over the margin, as a fraction of the canvas' height.
    const point = this.toScreen(at);
    const { left, top, width, height } = this.area;
    const beyond = (pixels: number, free: number): number => Math.sign(pixels) * Math.max(0, Math.abs(pixels) - free);
    const across = beyond(point.x - left - width / 2, 0.5 * followMargin.across * width);
    const upright = beyond(point.y - top - height / 2, 0.5 * followMargin.upright * height);
    const right = across / this.canvas.clientHeight;
    const up = -upright / this.canvas.clientHeight;
    const inFront = Math.abs(at.clone().project(this.camera).z) < 1;
    if (Number.isFinite(right + up) && inFront && Math.hypot(right, up) > 1e-3) {
      this.pan(rate * right, rate * up);
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
    this.area = this.measureArea();
    this.applyArea();
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
      this.ground.showShadows(false);
    } else if (this.pixelRatio > 0.5) {
      this.pixelRatio = Math.max(0.5, 0.7 * this.pixelRatio);
      this.resize();
    }
  }
}
