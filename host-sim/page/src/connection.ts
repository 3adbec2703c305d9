// The stream from host-sim: connects, reads, and connects again when host-sim comes back.
import {
  kindOf,
  readFrame,
  readGeometry,
  readSamples,
  type DeviceMessage,
  type Frame,
  type Geometry,
  type RecordMessage,
  type RefusedMessage,
  type Samples,
  type SceneMessage,
  type TextMessage,
} from "./protocol.ts";

/** What the page may ask, as PROTOCOL.md has it. */
export type Request =
  | { type: "watch"; particles: boolean; planes: boolean; samples: boolean }
  | { type: "set"; key: string; value: number }
  | { type: "pause"; on: boolean }
  | { type: "step"; steps: number }
  | { type: "reset" }
  | { type: "scene"; name: string }
  | { type: "record"; on: boolean }
  | { type: "hand"; position: [number, number, number]; orientation?: [number, number, number, number]; curl?: number }
  | { type: "release" }
  | { type: "script" }
  | { type: "seek"; time: number }
  | { type: "speed"; speed: number };

export type ConnectionState = "connecting" | "connected" | "lost";

/** Whoever wants to know. `scene` and `geometry` come together, in `onScene`. */
export interface Listener {
  onState(state: ConnectionState): void;
  onScene(scene: SceneMessage, geometry: Geometry): void;
  onFrame(frame: Frame): void;
  onSamples(samples: Samples): void;
  onDevice(device: DeviceMessage): void;
  onRefused(refused: RefusedMessage): void;
  onRecord(record: RecordMessage): void;
}

const subprotocol = "haptic-view-1";
const shortestWait = 250; // ms, before the next attempt
const longestWait = 4000;

export class Connection {
  private socket: WebSocket | null = null;
  private wait = shortestWait;
  private scene: SceneMessage | null = null;
  private watched: Request = { type: "watch", particles: false, planes: false, samples: true };

  constructor(
    private readonly url: string,
    private readonly listener: Listener,
  ) {}

  open(): void {
    this.listener.onState("connecting");
    const socket = new WebSocket(this.url, subprotocol);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.wait = shortestWait;
      this.listener.onState("connected");
      this.send(this.watched);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (typeof event.data === "string") {
        this.readText(event.data);
      } else {
        this.readBinary(event.data);
      }
    };
    socket.onclose = () => {
      this.socket = null;
      this.scene = null;
      this.listener.onState("lost");
      setTimeout(() => this.open(), this.wait);
      this.wait = Math.min(2 * this.wait, longestWait);
    };
    this.socket = socket;
  }

  /** Asks now, or not at all: what was asked while there was no connection is not asked later. */
  send(request: Request): void {
    if (this.socket?.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(request));
    }
  }

  /** What is streamed besides surfaces and tool, now and after each new connection. */
  watch(particles: boolean, planes: boolean): void {
    this.watched = { type: "watch", particles, planes, samples: true };
    this.send(this.watched);
  }

  private readText(text: string): void {
    const message = JSON.parse(text) as TextMessage;
    switch (message.type) {
      case "scene":
        this.scene = message;
        break;
      case "device":
        this.listener.onDevice(message);
        break;
      case "refused":
        this.listener.onRefused(message);
        break;
      case "record":
        this.listener.onRecord(message);
        break;
      case "bye": // the connection ends next
    }
  }

  private readBinary(buffer: ArrayBuffer): void {
    switch (kindOf(buffer)) {
      case 1:
        if (this.scene) {
          this.listener.onScene(this.scene, readGeometry(buffer, this.scene));
        }
        break;
      case 2:
        this.listener.onFrame(readFrame(buffer));
        break;
      case 3:
        this.listener.onSamples(readSamples(buffer));
        break;
      default: // of a later host-sim
    }
  }
}
