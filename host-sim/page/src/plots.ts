// The strip of plots: what the hand feels, what host-sim's steps take, and how rt-core keeps its beat.
import { element, setText } from "./dom.ts";
import { colourOf } from "./colours.ts";
import { isConnectedDevice, deviceWords } from "./device_words.ts";
import { AgePlot, FeelPlot, PeriodPlot, type StripPlot, StagePlot } from "./strip_plots.ts";
import { type DeviceMessage, sampleColumns, type Samples, type SceneMessage } from "./protocol.ts";
import { History } from "./series.ts";

const redrawEvery = 70; // ms
const kept = 1 << 14; // samples: 16 s at 1 kHz, 8 s at 2 kHz
const agesKept = 600; // two minutes of them

/** Fills `root`. */
export class Plots {
  private readonly samples = new History(sampleColumns.length, kept);
  private readonly ages = new History(3, agesKept);
  private readonly feel: FeelPlot;
  private readonly stages: StagePlot;
  private readonly period: PeriodPlot;
  private readonly age: AgePlot;
  private readonly device = element("p", { class: "device", role: "status" }, "No rt-core: the hand is not a device.");
  private readonly devicePlots = element("div", { class: "device-plots", hidden: true });
  private lastDevice: DeviceMessage | null = null;
  private drawn = -Infinity;
  private stale = true;
  private shown = true;

  constructor(private readonly root: HTMLElement) {
    this.feel = new FeelPlot(this.samples);
    this.stages = new StagePlot(this.samples, () => this.touch());
    this.period = new PeriodPlot();
    this.age = new AgePlot(this.ages);
    this.devicePlots.append(this.period.root, this.age.root);
    root.append(
      this.feel.root,
      this.stages.root,
      element("div", { class: "device-part" }, this.device, this.devicePlots),
    );
    new ResizeObserver(() => this.touch()).observe(root);
    this.takeColours();
    const frame = (now: number): void => {
      requestAnimationFrame(frame);
      if (this.stale && this.shown && now - this.drawn >= redrawEvery) {
        this.drawn = now;
        this.stale = false;
        this.plots().forEach((plot) => plot.draw());
      }
    };
    requestAnimationFrame(frame);
  }

  showScene(_scene: SceneMessage): void {
    this.samples.clear();
    this.touch();
  }

  showSamples(samples: Samples): void {
    if (samples.dropped > 0) {
      this.samples.gap();
    }
    for (let i = 0; i < samples.count; ++i) {
      this.samples.push(samples.times[i]!, samples.values, sampleColumns.length * i);
    }
    this.touch();
  }

  showDevice(device: DeviceMessage): void {
    const connected = isConnectedDevice(device);
    this.devicePlots.hidden = !connected;
    setText(this.device, deviceWords(device));
    this.device.classList.toggle("faulty", device.faults.length > 0);
    if (connected) {
      this.lastDevice = device;
      const { p50, p99, max } = device.frame_age_ms;
      this.ages.push(performance.now() / 1000, [p50, p99, max]);
    }
    this.period.show(device);
    this.touch();
  }

  /** A strip that is folded is not drawn. */
  show(on: boolean): void {
    this.shown = on;
    this.root.hidden = !on;
    this.touch();
  }

  /** After a change between light and dark, or of the size of letters. */
  takeColours(): void {
    const letters = parseFloat(getComputedStyle(document.documentElement).fontSize);
    this.plots().forEach((plot) => plot.take({ colourOf, letters }));
    if (this.lastDevice) {
      this.period.show(this.lastDevice);
    }
    this.touch();
  }

  private plots(): StripPlot[] {
    return [this.feel, this.stages, this.period, this.age];
  }

  private touch(): void {
    this.stale = true;
  }
}
