// Camera, light, ground and renderer: where things are seen.
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

const fieldOfView = 40; // degrees, upright
const lookFrom = new Vector3(0.45, 0.4, 1).normalize();
const slowest = 50; // ms from picture to picture, from which on less is drawn
const judged = 12; // pictures, one right after the other
const gridCells = 40;
const middle = 0.3; // of half the picture, out of which what is followed does not get
const followed = 0.12; // part of what it is beyond that is made up for in each picture

export class Stage {
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
  private pictures = 0; // one right after the other
  private since = 0; // ms, when the first of them was drawn
  private sharpness = Math.min(devicePixelRatio, 2);

  /** Throws where the browser has no WebGL. */
  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.toneMapping = NeutralToneMapping;
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = PCFSoftShadowMap;
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(1024, 1024);
    this.sun.shadow.normalBias = 0.02;
    this.ground.rotation.x = -Math.PI / 2;
    this.ground.receiveShadow = true;
    this.ground.visible = false;
    this.scene.add(this.sky, this.sun, this.sun.target, this.ground);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.controls.dampingFactor = 0.15;
    this.controls.zoomToCursor = true;
    this.controls.addEventListener("change", () => this.touch());
    new ResizeObserver(() => this.resize()).observe(canvas);
    // What was on the graphics card is put there again by the renderer once the context is back.
    canvas.addEventListener("webglcontextlost", (event) => event.preventDefault());
    canvas.addEventListener("webglcontextrestored", () => this.touch());
    this.takeColours();
    this.resize();
  }

  /** Something is to be seen that was not. */
  touch(): void {
    this.changed = true;
  }

  /** Draws, if anything has changed since. Returns whether it did. */
  draw(): boolean {
    this.controls.update();
    if (!this.changed) {
      this.pictures = 0;
      return false;
    }
    this.changed = false;
    this.renderer.render(this.scene, this.camera);
    this.judge(performance.now());
    return true;
  }

  takeColours(): void {
    this.scene.background = new Color(colourOf("paper"));
    const dark = isDark();
    this.sky.color.set(0xffffff);
    this.sky.groundColor.set(dark ? 0x5a6066 : 0xb9b2a6);
    this.sky.intensity = dark ? 1.5 : 1.9;
    this.setGround(this.groundHeight);
    this.touch();
  }

  /** m; null: the scene has none. */
  setGround(height: number | null): void {
    this.groundHeight = height;
    this.grid?.removeFromParent();
    this.grid?.dispose();
    this.grid = null;
    this.ground.visible = false;
    if (height === null || !this.groundShown) {
      return;
    }
    const size = gridCells * this.gridCell;
    const line = new Color(colourOf("line"));
    this.grid = new GridHelper(size, gridCells, line, line);
    const centre = this.controls.target.clone().divideScalar(this.gridCell).round().multiplyScalar(this.gridCell);
    this.grid.position.set(centre.x, height, centre.z);
    this.ground.scale.set(size, size, 1);
    this.ground.position.set(centre.x, height - 0.002 * this.gridCell, centre.z);
    this.ground.visible = this.sun.castShadow;
    this.scene.add(this.grid);
    this.touch();
  }

  showGround(on: boolean): void {
    this.groundShown = on;
    this.setGround(this.groundHeight);
  }

  /** Puts a box into the middle of the picture. `turned`: also looks at it from where one usually does. */
  frame(box: Box3, turned: boolean): void {
    if (box.isEmpty()) {
      return;
    }
    const centre = box.getCenter(new Vector3());
    const radius = Math.max(0.5 * box.getSize(new Vector3()).length(), 1e-3);
    const half = (fieldOfView * Math.PI) / 360;
    const across = Math.atan(Math.tan(half) * Math.min(1, this.camera.aspect));
    const distance = radius / Math.sin(across);
    const from = turned ? lookFrom.clone() : this.camera.position.clone().sub(this.controls.target).normalize();
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(from, distance);
    this.camera.near = distance / 200;
    this.camera.far = distance * 50;
    this.camera.updateProjectionMatrix();
    this.controls.minDistance = distance / 30;
    this.controls.maxDistance = distance * 10;
    this.lightFor(centre, radius);
    this.gridCell = roundScale(0.4 * radius);
    this.setGround(this.groundHeight);
    this.touch();
  }

  orbit(about: number, up: number): void {
    const away = this.camera.position.clone().sub(this.controls.target);
    const place = new Spherical().setFromVector3(away);
    place.theta -= about;
    place.phi = Math.min(Math.max(place.phi - up, 0.05), Math.PI - 0.05);
    this.camera.position.copy(this.controls.target).add(away.setFromSpherical(place));
    this.touch();
  }

  /** By parts of the picture's height. */
  pan(right: number, up: number): void {
    const move = this.acrossPicture(this.controls.target, right, up);
    this.camera.position.add(move);
    this.controls.target.add(move);
    this.touch();
  }

  zoom(factor: number): void {
    const away = this.camera.position.clone().sub(this.controls.target);
    away.setLength(Math.min(Math.max(away.length() * factor, this.controls.minDistance), this.controls.maxDistance));
    this.camera.position.copy(this.controls.target).add(away);
    this.touch();
  }

  /** m at a place of the scene, for parts of the picture's height to the right and up. */
  acrossPicture(at: Vector3, right: number, up: number): Vector3 {
    const height = this.heightAt(at);
    const x = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
    const y = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 1);
    return x.multiplyScalar(right * height).addScaledVector(y, up * height);
  }

  /** m that the picture is high, as far away as a place is. */
  heightAt(at: Vector3): number {
    const depth = at.clone().sub(this.camera.position).dot(this.away());
    return 2 * Math.max(depth, this.camera.near) * Math.tan((fieldOfView * Math.PI) / 360);
  }

  /** Unit, into the picture. */
  away(): Vector3 {
    return this.camera.getWorldDirection(new Vector3());
  }

  /** Moves with a place so that it stays in the middle of the picture. */
  follow(at: Vector3): void {
    const place = at.clone().project(this.camera);
    const beyond = (part: number): number => Math.sign(part) * Math.max(0, Math.abs(part) - middle);
    const right = 0.5 * beyond(place.x) * this.camera.aspect;
    const up = 0.5 * beyond(place.y);
    if (Number.isFinite(right + up) && Math.abs(place.z) < 1 && Math.hypot(right, up) > 1e-3) {
      this.pan(followed * right, followed * up);
    }
  }

  /** CSS pixels from the canvas' left upper corner. */
  onScreen(at: Vector3): { x: number; y: number } {
    const place = at.clone().project(this.camera);
    return {
      x: ((place.x + 1) / 2) * this.canvas.clientWidth,
      y: ((1 - place.y) / 2) * this.canvas.clientHeight,
    };
  }

  private lightFor(centre: Vector3, radius: number): void {
    this.sun.position.copy(centre).add(new Vector3(0.6, 1.1, 1.1).multiplyScalar(2 * radius));
    this.sun.target.position.copy(centre);
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
    this.renderer.setPixelRatio(this.sharpness);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.touch();
  }

  /** Gives up shadows, then sharpness, where pictures follow one another too slowly. */
  private judge(now: number): void {
    if (this.pictures === 0) {
      this.since = now;
    }
    if (++this.pictures <= judged) {
      return;
    }
    this.pictures = 0;
    if ((now - this.since) / judged < slowest) {
      return;
    }
    if (this.sun.castShadow) {
      this.sun.castShadow = false;
      this.ground.visible = false;
    } else if (this.sharpness > 0.5) {
      this.sharpness = Math.max(0.5, 0.7 * this.sharpness);
      this.resize();
    }
  }
}
