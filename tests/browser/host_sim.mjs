// Runs the real host-sim.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import path from "node:path";

const running = new Set();
const folders = [];

/** Starts `host-sim ARGUMENTS... --view 127.0.0.1:PORT` and waits for its address; port 0 selects a free one. */
export async function startView(args, { port = 0 } = {}) {
  const child = spawn(process.env.HOST_SIM, [...args, "--view", `127.0.0.1:${port}`], { stdio: ["ignore", "ignore", "pipe"] });
  const started = { child, url: "", log: "" };
  running.add(started);
  await new Promise((resolve, reject) => {
    child.once("error", reject);
    child.once("exit", (status) => reject(new Error(`host-sim ended with ${status} before its view was there:\n${started.log}`)));
    child.stderr.on("data", (text) => {
      started.log += text;
      const found = started.log.match(/live view is at (http:\/\/\S+)/);
      if (found) {
        resolve();
        started.url = found[1];
      }
    });
  });
  started.port = Number(new URL(started.url).port);
  return started;
}

export const startRun = (scene, { control = true, port = 0 } = {}) =>
  startView(["run", scene, "--session", `browser-${process.pid}`, ...(control ? ["--view-control"] : [])], { port });

/** Stops it and returns its exit status or signal. */
export async function end(started, signal = "SIGINT") {
  running.delete(started);
  const { child } = started;
  if (child.exitCode === null && child.signalCode === null) {
    const ended = once(child, "exit");
    child.kill(signal);
    await ended;
  }
  return child.exitCode ?? child.signalCode;
}

/** Runs host-sim with `args` to its end; throws with its output if it fails. */
export async function runToEnd(args) {
  const child = spawn(process.env.HOST_SIM, args, { stdio: ["ignore", "pipe", "pipe"] });
  let said = "";
  child.stdout.on("data", (text) => (said += text));
  child.stderr.on("data", (text) => (said += text));
  const [status] = await once(child, "close");
  if (status !== 0) {
    throw new Error(`host-sim ${args.join(" ")} ended with ${status}:\n${said}`);
  }
  return said;
}

/** A temporary folder, removed after the claim. */
export function scratchFolder() {
  folders.push(mkdtempSync(path.join(tmpdir(), "haptic-browser-")));
  return folders.at(-1);
}

export async function stopAll() {
  for (const started of [...running]) {
    await end(started);
  }
  folders.splice(0).forEach((folder) => rmSync(folder, { recursive: true, force: true }));
}
