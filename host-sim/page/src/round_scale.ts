/** The largest 1, 2 or 5 times a power of ten that does not exceed a positive value. */
export function roundScale(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  const digit = value / power;
  return power * (digit >= 5 ? 5 : digit >= 2 ? 2 : 1);
}
