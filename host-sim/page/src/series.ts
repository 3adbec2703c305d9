// Sample history for the plots, and its decimation to the width of a plot.

/** Ring buffer of the newest rows of samples against increasing time. */
export class History {
  private readonly times: Float64Array;
  private readonly values: Float32Array;
  private first = 0; // index of the oldest row
  private rows = 0;

  constructor(
    readonly columns: number,
    readonly capacity: number,
  ) {
    this.times = new Float64Array(capacity);
    this.values = new Float32Array(columns * capacity);
  }

  get length(): number {
    return this.rows;
  }
  /** Time of row `i`; 0 is the oldest. */
  time(i: number): number {
    return this.times[this.slot(i)] ?? NaN;
  }
  value(i: number, column: number): number {
    return this.values[this.columns * this.slot(i) + column] ?? NaN;
  }
  /** Time of the newest row; NaN if there is none. */
  get newest(): number {
    return this.rows > 0 ? this.time(this.rows - 1) : NaN;
  }

  clear(): void {
    this.rows = 0;
  }

  /** Appends a row. A time before the newest, as after a reset, clears the history. */
  push(time: number, row: ArrayLike<number>, offset = 0): void {
    if (this.rows > 0 && time < this.newest) {
      this.clear();
    }
    // When full, overwrite the oldest row.
    if (this.rows === this.capacity) {
      this.first = (this.first + 1) % this.capacity;
    } else {
      ++this.rows;
    }
    const slot = this.slot(this.rows - 1);
    this.times[slot] = time;
    for (let k = 0; k < this.columns; ++k) {
      this.values[this.columns * slot + k] = row[offset + k] ?? NaN;
    }
  }

  /** Marks a gap: the line breaks between the rows before and after. */
  gap(): void {
    if (this.rows > 0) {
      this.push(this.newest, new Float32Array(this.columns).fill(NaN));
    }
  }

  /** The first row at or after `time`. */
  indexOf(time: number): number {
    let low = 0;
    let high = this.rows;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time(middle) < time) {
        low = middle + 1;
      } else {
        high = middle;
      }
    }
    return low;
  }

  private slot(i: number): number {
    return (this.first + i) % this.capacity;
  }
}

/** Times, and the values of each requested column; null breaks the line. */
export interface Decimated {
  times: number[];
  columns: (number | null)[][];
}

/**
 * Reduces the rows from `from` to `to` to two points per bin, the minimum and maximum of each column, so that no peak
 * is lost. Bins lie at integer multiples of their width, so a scrolling plot does not flicker. Fewer rows than points
 * are returned unchanged.
 */
export function decimate(history: History, wanted: number[], from: number, to: number, bins: number): Decimated {
  const begin = history.indexOf(from);
  const end = history.indexOf(to + 1e-9);
  const result: Decimated = { times: [], columns: wanted.map(() => []) };
  if (end - begin <= 2 * bins) {
    for (let i = begin; i < end; ++i) {
      result.times.push(history.time(i));
      wanted.forEach((column, k) => result.columns[k]!.push(orNull(history.value(i, column))));
    }
    return result;
  }
  // Group the rows by bin; each bin gives its two extremes in the order of their times.
  const width = (to - from) / bins;
  for (let i = begin; i < end;) {
    const bin = Math.floor(history.time(i) / width);
    let next = i + 1;
    while (next < end && Math.floor(history.time(next) / width) === bin) {
      ++next;
    }
    result.times.push((bin + 0.25) * width, (bin + 0.75) * width);
    wanted.forEach((column, k) => {
      const [first, second] = extremes(history, column, i, next);
      result.columns[k]!.push(orNull(first), orNull(second));
    });
    i = next;
  }
  return result;
}

function orNull(value: number): number | null {
  return Number.isNaN(value) ? null : value;
}

/** Minimum and maximum of a column over some rows, in the order of their times; NaN if no row has a value. */
function extremes(history: History, column: number, begin: number, end: number): [number, number] {
  let min = NaN;
  let max = NaN;
  let minAt = begin;
  let maxAt = begin;
  for (let i = begin; i < end; ++i) {
    const value = history.value(i, column);
    if (Number.isNaN(value)) {
      continue;
    }
    if (!(value >= min)) {
      min = value;
      minAt = i;
    }
    if (!(value <= max)) {
      max = value;
      maxAt = i;
    }
  }
  return minAt <= maxAt ? [min, max] : [max, min];
}

/** The rows from `from` to `to` as CSV, with a header line; a gap leaves its fields empty. */
export function toCsv(history: History, names: string[], from: number, to: number): string {
  const lines = [names.join(",")];
  const end = history.indexOf(to + 1e-9);
  for (let i = history.indexOf(from); i < end; ++i) {
    const fields = Array.from({ length: history.columns }, (_, k) => history.value(i, k));
    lines.push([history.time(i), ...fields].map((value) => (Number.isNaN(value) ? "" : String(value))).join(","));
  }
  return `${lines.join("\n")}\n`;
}
