// Connection to host-sim's stream: connects, decodes messages, and reconnects when host-sim returns.
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

/** Requests of the page (PROTOCOL.md). */
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

/** Receiver of messages. `scene` and `geometry` arrive together, in `onScene`. */
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
const minRetryDelay = 250; // ms, before the first attempt to reconnect
const maxRetryDelay = 4000;

export class Connection {
  private socket: WebSocket | null = null;
  private retryDelay = minRetryDelay;
  private scene: SceneMessage | null = null;
  private subscription: Request = { type: "watch", particles: false, planes: false, samples: true };

  constructor(
    private readonly url: string,
    private readonly listener: Listener,
  ) {}

  open(): void {
    this.listener.onState("connecting");
    // A new socket; the subscription is renewed once it is open.
    const socket = new WebSocket(this.url, subprotocol);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => {
      this.retryDelay = minRetryDelay;
      this.listener.onState("connected");
      this.send(this.subscription);
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (typeof event.data === "string") {
        this.readText(event.data);
      } else {
        this.readBinary(event.data);
      }
    };
    // Reconnect with exponential back-off.
    socket.onclose = () => {
      this.socket = null;
      this.scene = null;
      this.listener.onState("lost");
      setTimeout(() => this.open(), this.retryDelay);
      this.retryDelay = Math.min(2 * this.retryDelay, maxRetryDelay);
    };
    this.socket = socket;
  }

  /** Sends a request if connected; otherwise drops it, so that it is not carried out unexpectedly later. */
  send(request: Request): void {
    if (this.socket?.readyState === WebSocket.OPEN) {
      this.socket.send(JSON.stringify(request));
    }
  }

  /** Subscribes to optional streams, now and after each reconnection. */
  watch(particles: boolean, planes: boolean): void {
    this.subscription = { type: "watch", particles, planes, samples: true };
    this.send(this.subscription);
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
