// Pressure of contacts on the surfaces, as colours.
import type { ContactForce, Triple } from "./protocol.ts";

// Linear red, green and blue, 0 to 1.
const warm: Triple = [1, 0.644, 0.069];
const hot: Triple = [0.68, 0.019, 0.047];
const decay = 0.995; // per frame, of the largest recent pressure
const faint = 0.02; // of the scale: no colour

/**
 * Pa, of a force that is spread over a disc of this radius by the pressure mask of the simulation (docs/forces.md):
 * 3 F / (pi R^2) (1 - d^2 / R^2)^2, whose integral over the disc is F.
 */
export function pressureAt(force: number, radius: number, distanceSquared: number): number {
  const inside = 1 - distanceSquared / (radius * radius);
  return inside > 0 ? ((3 * force) / (Math.PI * radius * radius)) * inside * inside : 0;
}

/** Adds the pressure of contacts to each vertex, Pa; returns the largest. */
export function addPressure(
  positions: Float32Array,
  contacts: ContactForce[],
  radius: number,
  pressure: Float32Array,
): number {
  let max = 0;
  for (const { point, force } of contacts) {
    for (let i = 0; i < pressure.length; ++i) {
      const [x, y, z] = [positions[3 * i]!, positions[3 * i + 1]!, positions[3 * i + 2]!];
      const away = (x - point[0]) ** 2 + (y - point[1]) ** 2 + (z - point[2]) ** 2;
      pressure[i] = pressure[i]! + pressureAt(force, radius, away);
      max = Math.max(max, pressure[i]!);
    }
  }
  return max;
}

/** The pressure that has the last colour, Pa: a round one that the largest recent pressure does not exceed. */
export class PressureScale {
  private recent = 0;
  top = 0;

  include(max: number): void {
    this.recent = Math.max(max, decay * this.recent);
    const power = 10 ** Math.floor(Math.log10(Math.max(this.recent, 1e-9)));
    this.top = power * ([1, 2, 5, 10].find((digit) => digit * power >= this.recent) ?? 10);
  }

  /** The colour of a pressure on a surface of this colour; both linear red, green and blue. */
  colour(pressure: number, base: Triple): Triple {
    const part = this.top > 0 ? Math.min(pressure / this.top, 1) : 0;
    if (part < faint) {
      return base;
    }
    return part < 0.4 ? mixed(base, warm, (part - faint) / (0.4 - faint)) : mixed(warm, hot, (part - 0.4) / 0.6);
  }
}

function mixed(from: Triple, to: Triple, part: number): Triple {
  return [0, 1, 2].map((k) => from[k]! + part * (to[k]! - from[k]!)) as Triple;
}
