// The single plots of the strip, each a uPlot with its title.
import uPlot from "uplot";

import { element } from "./dom.ts";
import type { DeviceMessage } from "./protocol.ts";
import { sampleColumns } from "./protocol.ts";
import { written } from "./scale.ts";
import { decimate, type History } from "./series.ts";

const seconds = 6; // of simulated time that are shown
const agesFor = 60; // s of the reader's time
const pixelsPerBin = 2;
const leastTime = 0.1; // us, where a logarithmic axis begins

/** What a plot takes from the page's style. */
export interface Look {
  colourOf(name: string): string;
  letters: number; // px, of the page's text
}

interface Line {
  label: string;
  colour: string; // a custom property
  scale?: string;
  dash?: number[];
  fill?: number; // how opaque below the line, 0 to 1
}

interface Axis {
  scale: string;
  label: string;
  side?: 1 | 3;
  decades?: boolean; // logarithmic, of us: marks at powers of ten only
}

/** A uPlot as large as its place, made anew when colours change. */
export abstract class StripPlot {
  readonly root: HTMLElement;
  private readonly place = element("div", { class: "plot-place" });
  protected plot: uPlot | null = null;
  private look: Look | null = null;
  private size = { width: 0, height: 0 };

  protected constructor(title: string, ...beside: Node[]) {
    const heading = element("div", { class: "plot-title" }, element("h2", {}, title), ...beside);
    this.root = element("figure", { class: "strip-plot", "aria-label": title }, heading, this.place);
    new ResizeObserver(() => this.fit()).observe(this.place);
  }

  take(look: Look): void {
    this.look = look;
    this.rebuild();
  }

  draw(): void {
    if (this.plot && this.size.width > 0) {
      this.fill(this.plot);
    }
  }

  protected abstract lines(): Line[];
  protected abstract axes(): Axis[];
  protected abstract scales(): uPlot.Scales;
  protected abstract fill(plot: uPlot): void;
  protected timeLabel(): string {
    return "s";
  }
  protected paths(): uPlot.Series.PathBuilder | null {
    return null;
  }
  protected hooks(): uPlot.Hooks.Arrays {
    return {};
  }

  protected colour(name: string): string {
    return this.look?.colourOf(name) ?? "gray";
  }
  /** How many bins of samples the plot's width is worth. */
  protected bins(): number {
    return Math.max(50, Math.floor((this.plot?.bbox.width ?? 300) / (pixelsPerBin * devicePixelRatio)));
  }

  protected rebuild(): void {
    const hidden = this.plot?.series.map((series) => series.show === false) ?? [];
    this.plot?.destroy();
    this.plot = null;
    if (!this.look) {
      return;
    }
    const lines = this.lines();
    const markers: uPlot.Legend.Markers = {
      width: 1.5,
      fill: () => "transparent",
      dash: (_plot, k) => (lines[k - 1]?.dash ? "dashed" : "solid"),
    };
    const options: uPlot.Options = {
      width: Math.max(this.size.width, 1),
      height: Math.max(this.size.height, 1),
      legend: { show: lines.length > 1, live: false, markers },
      padding: [6, this.axes().some(({ side }) => side === 1) ? 0 : 14, 0, 0],
      cursor: { drag: { x: false, y: false }, points: { show: false } },
      scales: this.scales(),
      hooks: this.hooks(),
      series: [{ label: this.timeLabel() }, ...lines.map((line, k) => this.seriesOf(line, hidden[k + 1] === true))],
      axes: [
        this.axisOf({ scale: "x", label: this.timeLabel() }, false),
        ...this.axes().map((axis) => this.axisOf(axis, true)),
      ],
    };
    this.plot = new uPlot(options, [[], ...lines.map(() => [])] as unknown as uPlot.AlignedData, this.place);
    this.fit();
  }

  private fit(): void {
    const legend = this.place.querySelector<HTMLElement>(".u-legend");
    const width = Math.floor(this.place.clientWidth);
    const height = Math.floor(this.place.clientHeight - (legend?.offsetHeight ?? 0));
    this.size = { width, height };
    if (this.plot && width > 0 && height > 0 && (this.plot.width !== width || this.plot.height !== height)) {
      this.plot.setSize({ width, height });
      this.draw();
    }
  }

  private seriesOf(line: Line, hidden: boolean): uPlot.Series {
    const colour = this.colour(line.colour);
    const paths = this.paths();
    return {
      label: line.label,
      scale: line.scale ?? "y",
      stroke: colour,
      width: 1.5,
      show: !hidden,
      points: { show: false },
      ...(line.dash ? { dash: line.dash } : {}),
      ...(line.fill ? { fill: withOpacity(colour, line.fill) } : {}),
      ...(paths ? { paths } : {}),
    };
  }

  private axisOf(axis: Axis, upright: boolean): uPlot.Axis {
    const letters = (this.look?.letters ?? 16) * 0.72;
    return {
      scale: axis.scale,
      stroke: this.colour("quiet"),
      font: `${letters}px system-ui, sans-serif`,
      size: upright ? 4.6 * letters : 2 * letters,
      gap: 3,
      space: upright ? 2.2 * letters : 4.5 * letters,
      ticks: { show: false },
      grid: { show: axis.side !== 1, stroke: this.colour("line"), width: 1 },
      values: (_plot, values) => values.map((value, k) => markOf(value, axis, k === values.length - 1)),
      ...(axis.side ? { side: axis.side } : {}),
      ...(axis.decades ? { splits: (_plot, _axis, min, max) => powersOfTen(min, max) } : {}),
    };
  }
}

function powersOfTen(min: number, max: number): number[] {
  const first = Math.round(Math.log10(min));
  return Array.from({ length: Math.max(0, Math.round(Math.log10(max)) - first) + 1 }, (_, k) => 10 ** (first + k));
}

/** A colour as the browser computed it, rgb(...), let through. */
function withOpacity(colour: string, opacity: number): string {
  return opacity < 1 ? colour.replace(/^rgb\((.*)\)$/, `rgb($1 / ${opacity})`).replace(/, /g, " ") : colour;
}

/** What is written at a mark. The unit stands at the last, in place of a title beside the axis, or at each power of ten. */
function markOf(value: number | null, axis: Axis, last: boolean): string {
  if (value === null) {
    return "";
  }
  if (axis.decades) {
    return value < 1000 ? `${written(value)} ${axis.label}` : `${written(value / 1000)} ms`;
  }
  return last ? `${written(value, 7)} ${axis.label}` : written(value, 7);
}

/** Range of an axis from zero to what there is, and a little at least. */
function fromZero(least: number): uPlot.Range.Function {
  return (_plot, _min, max) => [0, Math.max(1.08 * (max ?? 0), least)];
}

/** The last seconds of the samples, some of their columns. */
abstract class SamplePlot extends StripPlot {
  protected constructor(
    private readonly history: History,
    private readonly wanted: number[],
    title: string,
    ...beside: Node[]
  ) {
    super(title, ...beside);
  }

  protected abstract shownAs(column: number, value: number): number;

  protected fill(plot: uPlot): void {
    const newest = this.history.newest;
    const to = Number.isNaN(newest) ? seconds : Math.max(newest, seconds);
    const data = decimate(this.history, this.wanted, to - seconds, to, this.bins());
    const columns = data.columns.map((column, k) =>
      column.map((value) => (value === null ? null : this.shownAs(this.wanted[k]!, value))),
    );
    plot.batch(() => {
      plot.setData([data.times, ...columns] as uPlot.AlignedData, true);
      plot.setScale("x", { min: to - seconds, max: to });
    });
  }
}

const forceColumn = sampleColumns.indexOf("force");
const depthColumn = sampleColumns.indexOf("depth");
const firstStage = sampleColumns.indexOf("total");

/** Force at the hand, and how deep the proxy is held back from the hand. */
export class FeelPlot extends SamplePlot {
  constructor(history: History) {
    super(history, [forceColumn, depthColumn], "At the hand");
  }
  protected shownAs(column: number, value: number): number {
    return column === depthColumn ? 1000 * value : value;
  }
  protected lines(): Line[] {
    return [
      { label: "force, N", colour: "second", fill: 0.25 },
      { label: "proxy depth, mm", colour: "first", scale: "depth", dash: [6, 4] },
    ];
  }
  protected axes(): Axis[] {
    return [
      { scale: "y", label: "N" },
      { scale: "depth", label: "mm", side: 1 },
    ];
  }
  protected scales(): uPlot.Scales {
    return { x: { time: false, auto: false }, y: { range: fromZero(0.1) }, depth: { range: fromZero(1) } };
  }
}

/** What each part of a step takes. */
export class StagePlot extends SamplePlot {
  private logarithmic = true;

  constructor(history: History, touched: () => void) {
    const select = element("select", { "aria-label": "Axis of the stage times" });
    select.append(element("option", {}, "logarithmic"), element("option", {}, "linear"));
    const columns = sampleColumns.slice(firstStage).map((_, k) => firstStage + k);
    super(history, columns, "Stages of a step", select);
    select.addEventListener("change", () => {
      this.logarithmic = select.selectedIndex === 0;
      this.rebuild();
      touched();
    });
  }
  protected shownAs(_column: number, value: number): number {
    return this.logarithmic ? Math.max(value, leastTime) : value;
  }
  protected lines(): Line[] {
    const colours = ["ink", "first", "second", "third", "fourth"];
    return sampleColumns.slice(firstStage).map((label, k) => ({
      label,
      colour: k < 5 ? colours[k]! : colours[k - 4]!,
      ...(k < 5 ? {} : { dash: [5, 3] }),
    }));
  }
  protected axes(): Axis[] {
    return [{ scale: "y", label: "µs", decades: this.logarithmic }];
  }
  protected scales(): uPlot.Scales {
    const y: uPlot.Scale = this.logarithmic
      ? { distr: 3, range: (_plot, min, max) => decadesAbout(min, max) }
      : { range: fromZero(10) };
    return { x: { time: false, auto: false }, y };
  }
}

function decadesAbout(min: number | null, max: number | null): [number, number] {
  const low = 10 ** Math.floor(Math.log10(Math.max(min ?? 1, leastTime)));
  const high = 10 ** Math.ceil(Math.log10(Math.max(max ?? 100, 10 * low)));
  return [low, high];
}

/** How long rt-core's periods were: a bar for each bin, a line at the 99th percentile. */
export class PeriodPlot extends StripPlot {
  private device: DeviceMessage | null = null;

  constructor() {
    super("Periods of rt-core");
  }
  show(device: DeviceMessage): void {
    this.device = device;
  }
  protected override timeLabel(): string {
    return "µs";
  }
  protected lines(): Line[] {
    return [{ label: "ticks", colour: "third", fill: 1 }];
  }
  protected axes(): Axis[] {
    return [{ scale: "y", label: "" }];
  }
  protected scales(): uPlot.Scales {
    return { x: { time: false }, y: { range: fromZero(1) } };
  }
  protected override paths(): uPlot.Series.PathBuilder | null {
    return uPlot.paths.bars?.({ size: [0.9, 100], align: 0 }) ?? null;
  }
  protected override hooks(): uPlot.Hooks.Arrays {
    return { draw: [(plot) => this.drawMark(plot)] };
  }
  protected fill(plot: uPlot): void {
    const { edges, counts } = this.device?.period_us ?? { edges: [], counts: [] };
    const middles = counts.map((_, i) => ((edges[i] ?? 0) + (edges[i + 1] ?? 0)) / 2);
    plot.setData([middles, counts] as uPlot.AlignedData, true);
  }

  private drawMark(plot: uPlot): void {
    const p99 = this.device?.period_us.p99 ?? 0;
    const { min, max } = plot.scales["x"] ?? {};
    if (p99 <= 0 || min === undefined || max === undefined || p99 < min || p99 > max) {
      return;
    }
    const { ctx, bbox } = plot;
    const x = Math.round(plot.valToPos(p99, "x", true)) + 0.5;
    ctx.save();
    ctx.strokeStyle = ctx.fillStyle = this.colour("warn");
    ctx.setLineDash([4, 3]);
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    const right = x > bbox.left + bbox.width / 2;
    ctx.textAlign = right ? "right" : "left";
    ctx.textBaseline = "top";
    ctx.fillText(" p99 ", x, bbox.top);
    ctx.restore();
  }
}

/** How old host-sim's newest frame is when rt-core uses it, over the last minute. */
export class AgePlot extends StripPlot {
  constructor(private readonly history: History) {
    super("Age of host-sim's frames");
  }
  protected lines(): Line[] {
    return [
      { label: "half", colour: "first" },
      { label: "99 %", colour: "second" },
      { label: "most", colour: "quiet", dash: [5, 3] },
    ];
  }
  protected axes(): Axis[] {
    return [{ scale: "y", label: "ms" }];
  }
  protected scales(): uPlot.Scales {
    return { x: { time: false, auto: false }, y: { range: fromZero(1) } };
  }
  protected fill(plot: uPlot): void {
    const to = performance.now() / 1000;
    const data = decimate(this.history, [0, 1, 2], to - agesFor, to, this.bins());
    const ages = data.times.map((time) => time - to);
    plot.batch(() => {
      plot.setData([ages, ...data.columns] as uPlot.AlignedData, true);
      plot.setScale("x", { min: -agesFor, max: 0 });
    });
  }
}
