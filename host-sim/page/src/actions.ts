// Actions of the page's controls, carried out by main.ts.
import type { Request } from "./connection.ts";
import type { ViewOptions } from "./options.ts";

export interface Actions {
  /** Sends a request to host-sim. */
  send(request: Request): void;
  /** Switches a drawing option. */
  setOption(option: keyof ViewOptions, on: boolean): void;
  option(option: keyof ViewOptions): boolean;
  /** Moves the camera to show the whole scene, or the tool. */
  frameAll(): void;
  frameTool(): void;
  /** Saves the picture; starts a video, or ends and saves it. */
  savePicture(): void;
  toggleVideo(): void;
  /** Makes a scene of a mesh file. */
  openMesh(file: File): void;
  /** Clears the selection. */
  clearPick(): void;
  /** Rotates the camera around its target, rad; or shifts it by fractions of the view's height. */
  orbit(about: number, up: number): void;
  pan(right: number, up: number): void;
  /** Scales the distance of the camera; below 1 is nearer. */
  zoom(factor: number): void;
  /** Moves the hand by fractions of the view's height, in the image plane and away from the viewer; rotates it, rad. */
  moveHand(right: number, up: number, away: number): void;
  turnHand(about: number, up: number): void;
  /** Closes the hand, 0 (flat) to 1 (fist). */
  curlHand(curl: number): void;
  /** To be called after a change of the page's colours. */
  updateColours(): void;
}
