// What the controls of the page can make happen; main.ts does it.
import type { Request } from "./connection.ts";
import type { ViewOptions } from "./options.ts";

export interface Actions {
  /** Asks host-sim. */
  send(request: Request): void;
  /** Draws more or less. */
  setOption(option: keyof ViewOptions, on: boolean): void;
  option(option: keyof ViewOptions): boolean;
  /** The whole scene, or the tool, into the middle of the picture. */
  frameAll(): void;
  frameTool(): void;
  /** Turns the camera about what it looks at, rad; or moves it by parts of the picture's height. */
  orbit(about: number, up: number): void;
  pan(right: number, up: number): void;
  /** Comes nearer by a factor below 1. */
  zoom(factor: number): void;
  /** Moves the hand by parts of the picture's height, in the plane of the picture and away from the viewer; turns it, rad. */
  moveHand(right: number, up: number, away: number): void;
  turnHand(about: number, up: number): void;
  /** Closes the hand, 0 flat to 1 a fist. */
  curlHand(curl: number): void;
  /** After a change of the page's colours. */
  takeColours(): void;
}
