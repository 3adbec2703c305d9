// Recordings as one MCAP file: convert.mjs RECORDING.csv [MORE.csv ...] [--out FILE.mcap] [--names NAMES] [--offset SECONDS]
// See rt-core/docs/recording.md. Rows are read, merged by their time and written one by one, so that memory does not grow
// with the length of recordings.
import { existsSync } from "node:fs";
import { basename } from "node:path";
import { parseArgs } from "node:util";
import { UserError } from "./csv.mjs";
import { Output } from "./output.mjs";
import { Recording } from "./recording.mjs";

const usage = "usage: toolchain/mcap RECORDING.csv [MORE.csv ...] [--out FILE.mcap] [--names NAMES] [--offset SECONDS]";

/** @param {string[]} args */
function optionsOf(args) {
  let parsed;
  try {
    parsed = parseArgs({
      args: args.flatMap((arg, k) =>
        arg === "--offset" ? `--offset=${args[k + 1] ?? ""}` : args[k - 1] === "--offset" ? [] : arg,
      ), // may be negative
      allowPositionals: true,
      options: { out: { type: "string" }, names: { type: "string", default: "haptic" }, offset: { type: "string" } },
    });
  } catch (error) {
    throw new UserError(`${/** @type {Error} */ (error).message.split("\n")[0]}; ${usage}`);
  }
  const { values, positionals: files } = parsed;
  if (files.length === 0) {
    throw new UserError(`no recording given; ${usage}`);
  }
  const names = values.names ?? "haptic";
  if (!/^[A-Za-z_][A-Za-z0-9_]*(\/[A-Za-z_][A-Za-z0-9_]*)*$/.test(names)) {
    throw new UserError(
      `--names "${names}": words of the characters A-Z a-z 0-9 _ joined by /, none beginning with a digit`,
    );
  }
  const offset = Number(values.offset ?? 0);
  if (!Number.isFinite(offset) || values.offset === "") {
    throw new UserError(`--offset "${values.offset}": seconds, as in --offset -5000.000008`);
  }
  return {
    files,
    names,
    offset_ns: BigInt(Math.round(offset * 1e9)),
    out: values.out ?? `${files[0].replace(/\.csv$/, "")}.mcap`,
  };
}

/**
 * Opens all recordings, checks that they fit together, and gives each topics of its own.
 * @param {ReturnType<typeof optionsOf>} options
 */
function openAll({ files, names, offset_ns }) {
  const recordings = files.map((file) => new Recording(file, offset_ns));
  // One time base: rt-core's clock, or the time of scenes that ran in lockstep.
  const clocked = recordings.find((recording) => recording.clocked);
  const unclocked = recordings.find((recording) => !recording.clocked);
  if (clocked && unclocked) {
    throw new UserError(
      `${unclocked.name} has no time in common with ${clocked.name}: it was made in lockstep, or by a version that did not ` +
        "note its time-zero-ns. Convert it by itself, or record it with host-sim run --clock real",
    );
  }
  // The file's name where there are several of a kind.
  const taken = new Map();
  for (const recording of recordings) {
    const alone = recordings.filter((other) => other.kind === recording.kind).length === 1;
    const stem = basename(recording.name, ".csv").replace(/[^A-Za-z0-9_]/g, "_");
    recording.prefix = `/${names}${alone ? "" : `/${/^[0-9]/.test(stem) ? "_" : ""}${stem}`}`;
    recording.frameId = `${names.replaceAll("/", "_")}_device`;
    const key = `${recording.prefix}/${recording.kind.topic}`;
    if (taken.has(key)) {
      throw new UserError(
        `${recording.name} and ${taken.get(key)} would both be the topic ${key}: give one of them another name`,
      );
    }
    taken.set(key, recording.name);
  }
  return recordings;
}

/** Shows on a terminal how much has been read. @param {Recording[]} recordings */
function progressOf(recordings) {
  const all = recordings.reduce((sum, recording) => sum + recording.size, 0);
  return () => {
    if (process.stderr.isTTY) {
      const read = recordings.reduce((sum, recording) => sum + recording.read, 0);
      process.stderr.write(`\rconverting: ${Math.floor((100 * read) / all)} %\x1b[K`);
    }
  };
}

/**
 * Writes all rows in the order of their times.
 * @param {Recording[]} recordings
 * @param {Output} output
 */
async function merge(recordings, output) {
  for (const recording of recordings) {
    await recording.begin(output);
  }
  const rest = recordings.filter((recording) => recording.time_ns !== undefined);
  while (rest.length > 0) {
    let earliest = rest[0];
    for (const recording of rest) {
      if (/** @type {bigint} */ (recording.time_ns) < /** @type {bigint} */ (earliest.time_ns)) {
        earliest = recording;
      }
    }
    await earliest.write(output);
    if (!earliest.advance()) {
      rest.splice(rest.indexOf(earliest), 1);
    }
  }
  for (const recording of recordings) {
    await recording.end(output);
  }
}

/** Says what was not converted, and what may not fit. @param {Recording[]} recordings */
function warn(recordings) {
  for (const { name, torn } of recordings) {
    if (torn) {
      console.error(`${name}: the last line has no end and is left out; the run was killed there`);
    }
  }
  const late = recordings.find((a) => recordings.every((b) => a === b || a.first_ns > b.last_ns));
  if (recordings.length > 1 && late) {
    console.error(
      `${late.name} begins after all others have ended; if it was made on another machine, give --offset (see the documentation)`,
    );
  }
}

/** @param {string[]} args */
async function main(args) {
  const options = optionsOf(args);
  if (existsSync(options.out)) {
    throw new UserError(`${options.out} exists: delete it, or name another file with --out`);
  }
  const recordings = openAll(options);
  const output = await Output.open(options.out, progressOf(recordings));
  try {
    await merge(recordings, output);
    await output.finish();
  } catch (error) {
    output.discard();
    throw error;
  } finally {
    if (process.stderr.isTTY) {
      process.stderr.write("\r\x1b[K");
    }
  }
  warn(recordings);
  const rows = recordings.map((recording) => `${recording.rows} ${recording.kind.topic}`).join(", ");
  console.log(`wrote ${options.out}: ${rows}, ${(output.bytes / 1e6).toFixed(1)} MB`);
}

try {
  await main(process.argv.slice(2));
} catch (error) {
  if (!(error instanceof UserError)) {
    throw error;
  }
  console.error(`error: ${error.message}`);
  process.exitCode = 1;
}
