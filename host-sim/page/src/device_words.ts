// What a device's process tells of itself, in words.
import type { DeviceMessage } from "./protocol.ts";
import { steady, written } from "./scale.ts";

/** Whether there is an rt-core with something to plot. */
export function isConnectedDevice(device: DeviceMessage): boolean {
  return device.connected && device.state !== "absent";
}

/** State, beat, age of the frames, faults: all that matters to somebody who holds the device. */
export function deviceWords(device: DeviceMessage): string {
  if (!isConnectedDevice(device)) {
    return "No rt-core: the hand is not a device.";
  }
  const age = device.frame_age_ms;
  const words = [
    `rt-core is ${named(device.state)}`,
    `${written(device.rate_hz, 4)} Hz`,
    `${device.missed} ${device.missed === 1 ? "deadline" : "deadlines"} missed`,
    `period 99 % within ${steady(device.period_us.p99, 1, "µs")}`,
    `frames ${steady(age.p50, 1)} to ${steady(age.p99, 1, "ms")} old`,
    device.faults.length > 0 ? `faults: ${device.faults.map(named).join(", ")}` : "no faults",
  ];
  if (device.flags.length > 0) {
    words.push(`flags: ${device.flags.map(named).join(", ")}`);
  }
  return words.join(" · ");
}

function named(identifier: string): string {
  return identifier.replace(/_/g, " ");
}
