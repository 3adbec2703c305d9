// Slider scales (position to value and back) and number formatting.

export interface Scale {
  least: number;
  most: number;
  whole: boolean;
  logarithmic: boolean;
}

const decades = 4; // shown above zero by a logarithmic slider with minimum zero

function logarithmicMin(scale: Scale): number {
  return scale.least > 0 ? scale.least : scale.most / 10 ** decades;
}

/** Rounds to three significant digits, or to an integer, and clamps to the range. */
export function rounded(scale: Scale, value: number): number {
  const shortened = scale.whole ? Math.round(value) : Number(value.toPrecision(3));
  return Math.min(Math.max(shortened, scale.least), scale.most);
}

/**
 * The value at a slider position from 0 to 1. The left end of a logarithmic slider is its minimum, even if that is
 * zero.
 */
export function valueAtPosition(scale: Scale, position: number): number {
  if (position <= 0) {
    return scale.least;
  }
  if (position >= 1) {
    return scale.most;
  }
  const value =
    scale.logarithmic && scale.most > 0
      ? logarithmicMin(scale) * (scale.most / logarithmicMin(scale)) ** position
      : scale.least + (scale.most - scale.least) * position;
  return rounded(scale, value);
}

/** The slider position of a value, 0 to 1; values outside the range are clamped. */
export function sliderPosition(scale: Scale, value: number): number {
  if (!(scale.most > scale.least)) {
    return 0;
  }
  const position =
    scale.logarithmic && scale.most > 0
      ? Math.log(Math.max(value, logarithmicMin(scale)) / logarithmicMin(scale)) /
        Math.log(scale.most / logarithmicMin(scale))
      : (value - scale.least) / (scale.most - scale.least);
  return Math.min(Math.max(position, 0), 1);
}

/** A number with at most this many significant digits, without an exponent where possible. */
export function formatNumber(value: number, digits = 4): string {
  if (!Number.isFinite(value)) {
    return "–";
  }
  const shortened = Number(value.toPrecision(digits));
  const size = Math.abs(shortened);
  return size !== 0 && (size < 1e-5 || size >= 1e9) ? shortened.toExponential().replace("e+", "e") : String(shortened);
}

/** A number and its unit, with a non-breaking space. */
export function withUnit(value: number, unit: string, digits = 4): string {
  return unit === "" ? formatNumber(value, digits) : `${formatNumber(value, digits)}\u00a0${unit}`;
}

/** A number with fixed decimals, so that a readout does not change its width. */
export function formatFixed(value: number, decimals: number, unit = ""): string {
  const number = Number.isFinite(value) ? value.toFixed(decimals) : "–";
  return unit === "" ? number : `${number}\u00a0${unit}`;
}
