// Plot strip: force at the hand, times of host-sim's steps, and timing of rt-core.
import { button, element, setText } from "./dom.ts";
import { colourOf } from "./colours.ts";
import { isConnectedDevice, deviceText } from "./device_text.ts";
import { saveFile } from "./save.ts";
import { AgePlot, FeelPlot, PeriodPlot, type StripPlot, StagePlot, type TimeWindow } from "./strip_plots.ts";
import { type DeviceMessage, sampleColumns, type Samples, type SceneMessage } from "./protocol.ts";
import { History, toCsv } from "./series.ts";

const redrawInterval = 70; // ms
const sampleCapacity = 1 << 14; // samples: 16 s at 1 kHz, 8 s at 2 kHz
const ageCapacity = 600; // two minutes
const csvNames = ["time_s", "force_N", "torque_Nm", "depth_m", ...sampleColumns.slice(3).map((name) => `${name}_us`)];

/** Fills `root`. */
export class Plots {
  private readonly samples = new History(sampleColumns.length, sampleCapacity);
  private readonly ages = new History(3, ageCapacity);
  private readonly feel: FeelPlot;
  private readonly stages: StagePlot;
  private readonly period: PeriodPlot;
  private readonly age: AgePlot;
  private readonly device = element("p", { class: "device", role: "status" }, "No rt-core: no device moves the hand.");
  private readonly devicePlots = element("div", { class: "device-plots", hidden: true });
  private readonly live = button("Live", () => this.zoom(null), {
    hidden: true,
    title: "Follow the run again (double click)",
  });
  private readonly csv = button("CSV", () => this.saveCsv(), {
    title: "Save the samples of the shown time, or all that are kept while the plot follows the run",
  });
  private shownTime: TimeWindow | null = null;
  private scene = "";
  private lastDevice: DeviceMessage | null = null;
  private drawn = -Infinity;
  private stale = true;
  private shown = true;

  constructor(private readonly root: HTMLElement) {
    const zoom = (shown: TimeWindow | null): void => this.zoom(shown);
    this.feel = new FeelPlot(this.samples, zoom, element("span", { class: "buttons" }, this.live, this.csv));
    this.stages = new StagePlot(this.samples, zoom, () => this.invalidate());
    this.period = new PeriodPlot();
    this.age = new AgePlot(this.ages);
    this.devicePlots.append(this.period.root, this.age.root);
    root.append(
      this.feel.root,
      this.stages.root,
      element("div", { class: "device-part" }, this.device, this.devicePlots),
    );
    new ResizeObserver(() => this.invalidate()).observe(root);
    this.updateColours();
    // Redraw changed plots, at a limited rate.
    const frame = (now: number): void => {
      requestAnimationFrame(frame);
      if (this.stale && this.shown && now - this.drawn >= redrawInterval) {
        this.drawn = now;
        this.stale = false;
        this.plots().forEach((plot) => plot.draw());
      }
    };
    requestAnimationFrame(frame);
  }

  showScene(scene: SceneMessage): void {
    this.scene = scene.name;
    this.samples.clear();
    this.zoom(null);
  }

  /** Both plots of samples show the same time. */
  private zoom(shown: TimeWindow | null): void {
    this.shownTime = shown;
    this.live.hidden = shown === null;
    this.feel.setWindow(shown);
    this.stages.setWindow(shown);
    this.invalidate();
  }

  private saveCsv(): void {
    const { from, to } = this.shownTime ?? { from: -Infinity, to: Infinity };
    const csv = toCsv(this.samples, csvNames, from, to);
    saveFile(new Blob([csv], { type: "text/csv" }), `${this.scene}-samples.csv`);
  }

  showSamples(samples: Samples): void {
    if (samples.dropped > 0) {
      this.samples.gap();
    }
    for (let i = 0; i < samples.count; ++i) {
      this.samples.push(samples.times[i]!, samples.values, sampleColumns.length * i);
    }
    this.invalidate();
  }

  showDevice(device: DeviceMessage): void {
    const connected = isConnectedDevice(device);
    this.devicePlots.hidden = !connected;
    setText(this.device, deviceText(device));
    this.device.classList.toggle("faulty", device.faults.length > 0);
    if (connected) {
      this.lastDevice = device;
      const { p50, p99, max } = device.frame_age_ms;
      this.ages.push(performance.now() / 1000, [p50, p99, max]);
    }
    this.period.show(device);
    this.invalidate();
  }

  /** A folded strip is not drawn. */
  show(on: boolean): void {
    this.shown = on;
    this.root.hidden = !on;
    this.invalidate();
  }

  /** To be called after a change of colours or of the font size. */
  updateColours(): void {
    const fontSize = parseFloat(getComputedStyle(document.documentElement).fontSize);
    this.plots().forEach((plot) => plot.setStyle({ colourOf, fontSize }));
    if (this.lastDevice) {
      this.period.show(this.lastDevice);
    }
    this.invalidate();
  }

  private plots(): StripPlot[] {
    return [this.feel, this.stages, this.period, this.age];
  }

  private invalidate(): void {
    this.stale = true;
  }
}
