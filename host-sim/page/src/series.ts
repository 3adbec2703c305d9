// Samples of the last seconds, and what of them a plot some hundred pixels wide can show.

/** The newest rows of so many columns against a time that grows; older rows go. */
export class History {
  private readonly times: Float64Array;
  private readonly values: Float32Array;
  private first = 0; // where the oldest row is
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
  /** Of row `i`, 0 the oldest. */
  time(i: number): number {
    return this.times[this.slot(i)] ?? NaN;
  }
  value(i: number, column: number): number {
    return this.values[this.columns * this.slot(i) + column] ?? NaN;
  }
  /** NaN where there is none. */
  get newest(): number {
    return this.rows > 0 ? this.time(this.rows - 1) : NaN;
  }

  clear(): void {
    this.rows = 0;
  }

  /** Time that goes back, as after a reset, begins anew. */
  push(time: number, row: ArrayLike<number>, offset = 0): void {
    if (this.rows > 0 && time < this.newest) {
      this.clear();
    }
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

  /** Nothing is known between the rows before and those that follow: a line breaks here. */
  gap(): void {
    if (this.rows > 0) {
      this.push(this.newest, new Float32Array(this.columns).fill(NaN));
    }
  }

  /** The first row that is not before `time`. */
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

/** Times, and for each column that was asked for as many values; null breaks the line. */
export interface Decimated {
  times: number[];
  columns: (number | null)[][];
}

/**
 * The rows from `from` to `to` as two points a bin, the least and the greatest of each column, so that no peak is lost. Bins
 * lie at whole multiples of their width, and a picture that moves on does not flicker. Fewer rows than points stay as they are.
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

/** The least and the greatest value of some rows, in the order in which they came; NaN if no row has one. */
function extremes(history: History, column: number, begin: number, end: number): [number, number] {
  let least = NaN;
  let greatest = NaN;
  let leastAt = begin;
  let greatestAt = begin;
  for (let i = begin; i < end; ++i) {
    const value = history.value(i, column);
    if (Number.isNaN(value)) {
      continue;
    }
    if (!(value >= least)) {
      least = value;
      leastAt = i;
    }
    if (!(value <= greatest)) {
      greatest = value;
      greatestAt = i;
    }
  }
  return leastAt <= greatestAt ? [least, greatest] : [greatest, least];
}
