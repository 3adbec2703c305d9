// From the place of a slider to the value of a parameter and back, and numbers as they are read.

export interface Scale {
  least: number;
  most: number;
  whole: boolean;
  logarithmic: boolean;
}

const decades = 4; // that a logarithmic slider shows above zero, where zero is its least value

function lowest(scale: Scale): number {
  return scale.least > 0 ? scale.least : scale.most / 10 ** decades;
}

/** Three significant digits, or a whole number; within the range whatever the digits are. */
export function rounded(scale: Scale, value: number): number {
  const neat = scale.whole ? Math.round(value) : Number(value.toPrecision(3));
  return Math.min(Math.max(neat, scale.least), scale.most);
}

/** The value at a place from 0 to 1. The left end of a logarithmic slider is its least value, even where that is zero. */
export function valueAt(scale: Scale, place: number): number {
  if (place <= 0) {
    return scale.least;
  }
  if (place >= 1) {
    return scale.most;
  }
  const value =
    scale.logarithmic && scale.most > 0
      ? lowest(scale) * (scale.most / lowest(scale)) ** place
      : scale.least + (scale.most - scale.least) * place;
  return rounded(scale, value);
}

/** Where a value is, 0 to 1; what lies beyond an end is at that end. */
export function placeOf(scale: Scale, value: number): number {
  if (!(scale.most > scale.least)) {
    return 0;
  }
  const place =
    scale.logarithmic && scale.most > 0
      ? Math.log(Math.max(value, lowest(scale)) / lowest(scale)) / Math.log(scale.most / lowest(scale))
      : (value - scale.least) / (scale.most - scale.least);
  return Math.min(Math.max(place, 0), 1);
}

/** With so many significant digits at most, and without an exponent wherever a reader can do without. */
export function written(value: number, digits = 4): string {
  if (!Number.isFinite(value)) {
    return "–";
  }
  const neat = Number(value.toPrecision(digits));
  const size = Math.abs(neat);
  return size !== 0 && (size < 1e-5 || size >= 1e9) ? neat.toExponential().replace("e+", "e") : String(neat);
}

/** A number and its unit, with a space that does not break. */
export function withUnit(value: number, unit: string, digits = 4): string {
  return unit === "" ? written(value, digits) : `${written(value, digits)}\u00a0${unit}`;
}

/** The same number of decimals always, so that a readout does not jump about. */
export function steady(value: number, decimals: number, unit = ""): string {
  const number = Number.isFinite(value) ? value.toFixed(decimals) : "–";
  return unit === "" ? number : `${number}\u00a0${unit}`;
}
