// Text about the device's real-time process.
import type { DeviceMessage } from "./protocol.ts";
import { formatFixed, formatNumber } from "./scale.ts";

/** Whether an rt-core is connected and has data to plot. */
export function isConnectedDevice(device: DeviceMessage): boolean {
  return device.connected && device.state !== "absent";
}

/** State, tick rate, missed deadlines, period, age of the frames, faults and flags, for the user of a device. */
export function deviceText(device: DeviceMessage): string {
  if (!isConnectedDevice(device)) {
    return "No rt-core: no device moves the hand.";
  }
  const age = device.frame_age_ms;
  const waits = device.state === "disarmed" && device.flags.includes("arm_awaited");
  const words = [
    `rt-core is ${named(device.state)}${waits ? " until a person arms the device (rt-core arm)" : ""}`,
    `${formatNumber(device.rate_hz, 4)} Hz`,
    `${device.missed} ${device.missed === 1 ? "deadline" : "deadlines"} missed`,
    ...(device.unanswered > 0
      ? [`${formatFixed(100 * device.unanswered, 1, "%")} of the ticks unanswered by the board`]
      : []),
    `period 99 % within ${formatFixed(device.period_us.p99, 1, "µs")}`,
    `frames ${formatFixed(age.p50, 1)} to ${formatFixed(age.p99, 1, "ms")} old`,
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
