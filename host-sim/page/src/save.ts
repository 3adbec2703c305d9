// Saving what is seen: a picture as PNG, a video, and text files.
import { byId } from "./dom.ts";
import type { Viewport } from "./viewport.ts";

const framesPerSecond = 30;
const bitsPerSecond = 8e6;
const videoTypes = ["video/webm;codecs=vp9", "video/webm;codecs=vp8", "video/webm", "video/mp4"];
const inset = 12; // CSS pixels, of the words from the picture's edge

/** Offers content as a download. */
export function saveFile(content: Blob, name: string): void {
  const url = URL.createObjectURL(content);
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 60_000); // ms; the browser may still read it
}

export class Saver {
  private recorder: MediaRecorder | null = null;
  private canvas: HTMLCanvasElement | null = null; // of the video
  private drawnAt = -Infinity; // ms

  /** `nameOf`: of the file, without its ending. */
  constructor(
    private readonly viewport: Viewport,
    private readonly nameOf: () => string,
    private readonly changed: (recording: boolean) => void,
  ) {}

  get recording(): boolean {
    return this.recorder !== null;
  }

  savePicture(): void {
    const canvas = Object.assign(document.createElement("canvas"), this.viewport.screenSize);
    this.viewport.renderSharp();
    this.compose(canvas);
    this.viewport.endSharp();
    canvas.toBlob((blob) => blob && saveFile(blob, `${this.nameOf()}.png`), "image/png");
  }

  /** Starts a video, or ends and saves it. Throws if the browser cannot record. */
  toggleVideo(): void {
    if (this.recorder) {
      this.recorder.stop();
      return;
    }
    const type = videoTypes.find((one) => window.MediaRecorder?.isTypeSupported(one));
    if (!type) {
      throw new Error("this browser cannot record a video of a canvas");
    }
    const name = this.nameOf();
    const { width, height } = this.viewport.screenSize;
    // Video encoders need even sizes.
    this.canvas = Object.assign(document.createElement("canvas"), { width: width & ~1, height: height & ~1 });
    this.compose(this.canvas);
    const recorder = new MediaRecorder(this.canvas.captureStream(framesPerSecond), {
      mimeType: type,
      videoBitsPerSecond: bitsPerSecond,
    });
    const parts: Blob[] = [];
    recorder.ondataavailable = ({ data }) => parts.push(data);
    recorder.onstop = () => {
      recorder.stream.getTracks().forEach((track) => track.stop());
      this.recorder = this.canvas = null;
      this.changed(false);
      saveFile(new Blob(parts, { type }), `${name}.${type.includes("webm") ? "webm" : "mp4"}`);
    };
    recorder.start(1000);
    this.recorder = recorder;
    this.changed(true);
    this.viewport.invalidate();
  }

  /** To be called after each drawn picture, in the same task. */
  addFrame(): void {
    const now = performance.now();
    if (this.canvas && now - this.drawnAt >= 900 / framesPerSecond) {
      this.drawnAt = now;
      this.compose(this.canvas);
    }
  }

  /** The scene with its marks and the words of the title. */
  private compose(canvas: HTMLCanvasElement): void {
    const context = canvas.getContext("2d")!;
    const { width, height } = canvas;
    context.drawImage(this.viewport.canvas, 0, 0, width, height);
    context.drawImage(this.viewport.marks, 0, 0, width, height);
    const ratio = width / Math.max(this.viewport.canvas.clientWidth, 1);
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.textBaseline = "top";
    let y = inset;
    for (const words of [byId("scene-name"), ...byId("scene-state").children]) {
      const style = getComputedStyle(words);
      const size = parseFloat(style.fontSize);
      context.font = `${style.fontWeight} ${size}px ${style.fontFamily}`;
      context.fillStyle = style.color;
      context.fillText(words.textContent ?? "", inset, y);
      y += 1.35 * size;
    }
    context.setTransform(1, 0, 0, 1, 0, 0);
  }
}
