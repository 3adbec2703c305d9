// Plots of the strip, each a uPlot with a title.
import uPlot from "uplot";

import { element } from "./dom.ts";
import type { DeviceMessage } from "./protocol.ts";
import { sampleColumns } from "./protocol.ts";
import { formatNumber } from "./scale.ts";
import { decimate, type History } from "./series.ts";

const windowSeconds = 6; // shown, in simulated time
const ageWindow = 60; // s, in real time
const pixelsPerBin = 2;
const minTime = 0.1; // us, lower end of a logarithmic axis

/** Style of the page as used by plots. */
export interface PlotStyle {
  colourOf(name: string): string;
  fontSize: number; // px, of the page's text
}

interface Line {
  label: string;
  colour: string; // name of a CSS custom property
  scale?: string;
  dash?: number[];
  fill?: number; // opacity below the line, 0 to 1
}

interface Axis {
  scale: string;
  label: string;
  side?: 1 | 3;
  decades?: boolean; // logarithmic, in us: ticks at powers of ten only
}

/** The time that the plots of samples show: null follows the run. */
export interface TimeWindow {
  from: number; // s
  to: number;
}

/** Called when the reader zooms; null: back to following the run. */
export type Zoom = (shown: TimeWindow | null) => void;

const minWindow = 0.005; // s
const wheelZoom = 0.0015; // per pixel of wheel motion

/** A uPlot that fills its container and is rebuilt when colours change. */
export abstract class StripPlot {
  readonly root: HTMLElement;
  private readonly container = element("div", { class: "plot-container" });
  protected plot: uPlot | null = null;
  private style: PlotStyle | null = null;
  private size = { width: 0, height: 0 };

  protected constructor(title: string, ...beside: Node[]) {
    const heading = element("div", { class: "plot-title" }, element("h2", {}, title), ...beside);
    this.root = element("figure", { class: "strip-plot", "aria-label": title }, heading, this.container);
    new ResizeObserver(() => this.fit()).observe(this.container);
  }

  setStyle(style: PlotStyle): void {
    this.style = style;
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
  /** Whether dragging selects a time. */
  protected zooms(): boolean {
    return false;
  }

  protected colour(name: string): string {
    return this.style?.colourOf(name) ?? "gray";
  }
  /** Number of bins of samples that the plot's width can show. */
  protected bins(): number {
    return Math.max(50, Math.floor((this.plot?.bbox.width ?? 300) / (pixelsPerBin * devicePixelRatio)));
  }

  protected rebuild(): void {
    // A new plot keeps the hidden lines of the previous one.
    const hidden = this.plot?.series.map((series) => series.show === false) ?? [];
    this.plot?.destroy();
    this.plot = null;
    if (!this.style) {
      return;
    }
    // Legend markers show a line's dash.
    const lines = this.lines();
    const markers: uPlot.Legend.Markers = {
      width: 1.5,
      fill: () => "transparent",
      dash: (_plot, k) => (lines[k - 1]?.dash ? "dashed" : "solid"),
    };
    // The derived class defines lines, axes and scales.
    const options: uPlot.Options = {
      width: Math.max(this.size.width, 1),
      height: Math.max(this.size.height, 1),
      legend: { show: lines.length > 1, live: false, markers },
      padding: [6, this.axes().some(({ side }) => side === 1) ? 0 : 14, 0, 0],
      cursor: {
        drag: { x: this.zooms(), y: false, setScale: false },
        points: { show: false },
        bind: { dblclick: () => null },
      },
      scales: this.scales(),
      hooks: this.hooks(),
      series: [{ label: this.timeLabel() }, ...lines.map((line, k) => this.seriesOf(line, hidden[k + 1] === true))],
      axes: [
        this.axisOf({ scale: "x", label: this.timeLabel() }, false),
        ...this.axes().map((axis) => this.axisOf(axis, true)),
      ],
    };
    this.plot = new uPlot(options, [[], ...lines.map(() => [])] as unknown as uPlot.AlignedData, this.container);
    this.fit();
  }

  private fit(): void {
    // The plot gets the container's height less the legend's.
    const legend = this.container.querySelector<HTMLElement>(".u-legend");
    const width = Math.floor(this.container.clientWidth);
    const height = Math.floor(this.container.clientHeight - (legend?.offsetHeight ?? 0));
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
    // Sizes scale with the page's font. Labels and grid of the left axis only.
    const fontSize = (this.style?.fontSize ?? 16) * 0.72;
    return {
      scale: axis.scale,
      stroke: this.colour("quiet"),
      font: `${fontSize}px system-ui, sans-serif`,
      size: upright ? 4.6 * fontSize : 2 * fontSize,
      gap: 3,
      space: upright ? 2.2 * fontSize : 4.5 * fontSize,
      ticks: { show: false },
      grid: { show: axis.side !== 1, stroke: this.colour("line"), width: 1 },
      values: (_plot, values) => values.map((value, k) => tickLabel(value, axis, k === values.length - 1)),
      ...(axis.side ? { side: axis.side } : {}),
      ...(axis.decades ? { splits: (_plot, _axis, min, max) => powersOfTen(min, max) } : {}),
    };
  }
}

function powersOfTen(min: number, max: number): number[] {
  const first = Math.round(Math.log10(min));
  return Array.from({ length: Math.max(0, Math.round(Math.log10(max)) - first) + 1 }, (_, k) => 10 ** (first + k));
}

/** A computed colour, rgb(...), with an opacity. */
function withOpacity(colour: string, opacity: number): string {
  return opacity < 1 ? colour.replace(/^rgb\((.*)\)$/, `rgb($1 / ${opacity})`).replace(/, /g, " ") : colour;
}

/** Label of a tick. The unit is part of the last label instead of an axis title; on a logarithmic axis, of every label. */
function tickLabel(value: number | null, axis: Axis, last: boolean): string {
  if (value === null) {
    return "";
  }
  if (axis.decades) {
    return value < 1000 ? `${formatNumber(value)} ${axis.label}` : `${formatNumber(value / 1000)} ms`;
  }
  return last ? `${formatNumber(value, 7)} ${axis.label}` : formatNumber(value, 7);
}

/** Axis range from zero to slightly above the maximum, at least to `minTop`. */
function fromZero(minTop: number): uPlot.Range.Function {
  return (_plot, _min, max) => [0, Math.max(1.08 * (max ?? 0), minTop)];
}

/** Some columns of the samples, of the last seconds or of the time that the reader has zoomed into. */
abstract class SamplePlot extends StripPlot {
  private shown: TimeWindow | null = null;

  protected constructor(
    private readonly history: History,
    private readonly wanted: number[],
    private readonly zoom: Zoom,
    title: string,
    ...beside: Node[]
  ) {
    super(title, ...beside);
    this.root.addEventListener("wheel", (event) => this.onWheel(event), { passive: false });
    this.root.addEventListener("dblclick", () => this.zoom(null));
  }

  /** null: the last seconds. */
  setWindow(shown: TimeWindow | null): void {
    this.shown = shown;
  }

  protected abstract shownAs(column: number, value: number): number;

  protected override zooms(): boolean {
    return true;
  }
  protected override hooks(): uPlot.Hooks.Arrays {
    return { setSelect: [(plot) => this.onSelect(plot)] };
  }

  protected fill(plot: uPlot): void {
    // The window ends at the newest sample unless the reader has chosen one; decimate to the plot's width.
    const { from, to } = this.window();
    const data = decimate(this.history, this.wanted, from, to, this.bins());
    const columns = data.columns.map((column, k) =>
      column.map((value) => (value === null ? null : this.shownAs(this.wanted[k]!, value))),
    );
    plot.batch(() => {
      plot.setData([data.times, ...columns] as uPlot.AlignedData, true);
      plot.setScale("x", { min: from, max: to });
    });
  }

  private window(): TimeWindow {
    const newest = this.history.newest;
    const to = Number.isNaN(newest) ? windowSeconds : Math.max(newest, windowSeconds);
    return this.shown ?? { from: to - windowSeconds, to };
  }

  private onSelect(plot: uPlot): void {
    const { left, width } = plot.select;
    if (width > 3) {
      this.choose(plot.posToVal(left, "x"), plot.posToVal(left + width, "x"));
    }
    plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }

  /** The wheel zooms about the time under the cursor. */
  private onWheel(event: WheelEvent): void {
    const { plot } = this;
    if (!plot || event.ctrlKey) {
      return;
    }
    event.preventDefault();
    const { from, to } = this.window();
    const at = plot.posToVal(event.clientX - plot.over.getBoundingClientRect().left, "x");
    const factor = Math.exp(wheelZoom * event.deltaY);
    const middle = Math.min(Math.max(at, from), to);
    if (to - from > windowSeconds && factor > 1) {
      this.zoom(null);
    } else {
      this.choose(middle - (middle - from) * factor, middle + (to - middle) * factor);
    }
  }

  private choose(from: number, to: number): void {
    if (to - from >= minWindow) {
      this.zoom({ from, to });
    }
  }
}

const forceColumn = sampleColumns.indexOf("force");
const depthColumn = sampleColumns.indexOf("depth");
const firstStage = sampleColumns.indexOf("total");

/** Force at the hand, and depth of the hip behind the proxy. */
export class FeelPlot extends SamplePlot {
  constructor(history: History, zoom: Zoom, ...beside: Node[]) {
    super(history, [forceColumn, depthColumn], zoom, "At the hand", ...beside);
  }
  protected shownAs(column: number, value: number): number {
    return column === depthColumn ? 1000 * value : value;
  }
  protected lines(): Line[] {
    return [
      { label: "force, N", colour: "second", fill: 0.25 },
      { label: "hand behind the surface, mm", colour: "first", scale: "depth", dash: [6, 4] },
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

/** Labels of the stages, by their columns. */
const stageLabels: Partial<Record<(typeof sampleColumns)[number], string>> = {
  total: "whole step",
  ccd: "contact search",
  popout: "overlap removal",
  proxy: "contact planes",
  tool: "tool",
  collide: "collisions",
  deform: "deformation",
  skin: "surfaces",
};

/** Times of the stages of a step. */
export class StagePlot extends SamplePlot {
  private logarithmic = true;

  constructor(history: History, zoom: Zoom, changed: () => void) {
    const select = element("select", { "aria-label": "Axis of the stage times" });
    select.append(element("option", {}, "logarithmic"), element("option", {}, "linear"));
    const columns = sampleColumns.slice(firstStage).map((_, k) => firstStage + k);
    super(history, columns, zoom, "Computing time of a step", select);
    select.addEventListener("change", () => {
      this.logarithmic = select.selectedIndex === 0;
      this.rebuild();
      changed();
    });
  }
  protected shownAs(_column: number, value: number): number {
    return this.logarithmic ? Math.max(value, minTime) : value;
  }
  protected lines(): Line[] {
    const colours = ["ink", "first", "second", "third", "fourth"];
    return sampleColumns.slice(firstStage).map((column, k) => ({
      label: stageLabels[column] ?? column,
      colour: k < 5 ? colours[k]! : colours[k - 4]!,
      ...(k < 5 ? {} : { dash: [5, 3] }),
    }));
  }
  protected axes(): Axis[] {
    return [{ scale: "y", label: "µs", decades: this.logarithmic }];
  }
  protected scales(): uPlot.Scales {
    const y: uPlot.Scale = this.logarithmic
      ? { distr: 3, range: (_plot, min, max) => decadeRange(min, max) }
      : { range: fromZero(10) };
    return { x: { time: false, auto: false }, y };
  }
}

function decadeRange(min: number | null, max: number | null): [number, number] {
  const low = 10 ** Math.floor(Math.log10(Math.max(min ?? 1, minTime)));
  const high = 10 ** Math.ceil(Math.log10(Math.max(max ?? 100, 10 * low)));
  return [low, high];
}

/** Histogram of rt-core's periods, with a line at the 99th percentile. */
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
    // Pixel-aligned position of the line.
    const x = Math.round(plot.valToPos(p99, "x", true)) + 0.5;
    // Dashed vertical line, with its label on the side that has more room.
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

/** Age of host-sim's newest frame when rt-core uses it, over the last minute. */
export class AgePlot extends StripPlot {
  constructor(private readonly history: History) {
    super("Age of host-sim's frames");
  }
  protected lines(): Line[] {
    return [
      { label: "median", colour: "first" },
      { label: "99 %", colour: "second" },
      { label: "max", colour: "quiet", dash: [5, 3] },
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
    const data = decimate(this.history, [0, 1, 2], to - ageWindow, to, this.bins());
    const ages = data.times.map((time) => time - to);
    plot.batch(() => {
      plot.setData([ages, ...data.columns] as uPlot.AlignedData, true);
      plot.setScale("x", { min: -ageWindow, max: 0 });
    });
  }
}
