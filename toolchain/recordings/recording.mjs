// One recording as messages: each row with all its columns, and the device's motion where the row has it.
import { existsSync, readFileSync } from "node:fs";
import { basename } from "node:path";
import { CdrWriter } from "@foxglove/cdr";
import { CsvFile, UserError, reason } from "./csv.mjs";
import { definitionOf, kindOf, typeOf } from "./kinds.mjs";
import { motionMessages } from "./motion.mjs";

const timeZeroNote = "time-zero-ns ";
const maxTime_ns = 2n ** 63n - 1n;

/** @typedef {import("./output.mjs").Output} Output */

export class Recording {
  rows = 0;
  /** Topics lie below it. */
  prefix = "";
  frameId = "";
  /** Time of the current row; undefined after the last. @type {bigint | undefined} */
  time_ns;
  first_ns = 0n;
  last_ns = 0n;

  /** @type {CsvFile} */
  #csv;
  #offset_ns;
  /** @type {("float64" | "int64" | "uint64")[]} */
  #types;
  /** Of the current row. @type {(number | bigint)[]} */
  #values = [];
  /** Time of the last good exchange with the board, to which pose and velocity belong. @type {bigint | undefined} */
  #latch_ns;
  #channel = 0;
  /** @type {{ channel: number, columns: number[], write: (cdr: CdrWriter, values: number[]) => void }[]} */
  #motion = [];
  #buffer = new ArrayBuffer(1 << 16);

  /** @param {string} name @param {bigint} offset_ns added to the times of host-sim's */
  constructor(name, offset_ns) {
    this.#csv = new CsvFile(name);
    const kind = kindOf(this.#csv.columns);
    if (kind === undefined) {
      this.#csv.fail(
        "is no recording of rt-core run or host-sim run (no columns now_ns and tick, nor hip_x_m and step_us): give what their --record has written",
      );
    }
    this.kind = kind;
    const strange = this.#csv.columns.find((column) => !/^[a-z](_?[a-z0-9])*$/.test(column));
    if (strange !== undefined) {
      this.#csv.fail(`"${strange}" cannot be the name of a field: lower-case letters, digits and single _`);
    }
    const twice = this.#csv.columns.find((column, k) => this.#csv.columns.indexOf(column) !== k);
    if (twice !== undefined) {
      this.#csv.fail(`two columns are named "${twice}": a recording has each once, record again`);
    }
    this.#types = this.#csv.columns.map((column) => typeOf(kind, column));
    this.timeColumn = this.#csv.columns.indexOf(kind.time);
    this.exchange = this.#csv.columns.indexOf("exchange_in");
    this.#offset_ns = kind.time === "time_s" ? offset_ns : 0n;
    // The first row, and the notes before it.
    if (!this.advance()) {
      this.#csv.fail("has no rows: the run ended before its first");
    }
    this.first_ns = /** @type {bigint} */ (this.time_ns);
  }

  get name() {
    return this.#csv.name;
  }
  get size() {
    return this.#csv.size;
  }
  get read() {
    return this.#csv.read;
  }
  get torn() {
    return this.#csv.torn;
  }

  /** Reads the next row; false after the last. */
  advance() {
    const cells = this.#csv.next();
    if (cells === undefined) {
      this.time_ns = undefined;
      return false;
    }
    this.#values = cells.map((cell, k) => this.#valueOf(cell, k));
    if (this.rows === 0) {
      this.#findTimeZero();
    }
    const time_ns = this.#timeOfRow();
    if (time_ns < 0n || time_ns > maxTime_ns) {
      this.#csv.fail(`column ${this.kind.time}: the time is below zero or too large; is --offset right?`);
    }
    if (time_ns < this.last_ns) {
      this.#csv.fail(
        `column ${this.kind.time}: the time is before that of the row above: delete the line, or record again`,
      );
    }
    this.time_ns = this.last_ns = time_ns;
    return true;
  }

  /** @param {string} cell @param {number} column */
  #valueOf(cell, column) {
    const type = this.#types[column];
    if (type === "float64") {
      const value = Number(cell);
      if (!Number.isFinite(value)) {
        this.#csv.refuse(column, cell, "a finite number");
      }
      // A column that is new to this version may hold integers that no double has.
      if (cell.length > 15 && /^-?\d+$/.test(cell) && BigInt(cell) !== BigInt(value)) {
        this.#csv.fail(`column ${this.#csv.columns[column]}: a double cannot hold ${cell}; use a newer version`);
      }
      return value;
    }
    const bits = /^-?\d+$/.test(cell) ? BigInt(cell) : undefined;
    const held = bits !== undefined && (type === "int64" ? BigInt.asIntN(64, bits) : BigInt.asUintN(64, bits));
    if (bits === undefined || held !== bits) {
      this.#csv.refuse(column, cell, type === "int64" ? "an integer of 64 bits" : "a natural number of 64 bits");
    }
    return bits;
  }

  /** Whether the times are those of rt-core's clock, and then for host-sim since when. */
  #findTimeZero() {
    const note = this.#csv.notes.find((line) => line.startsWith(timeZeroNote));
    this.clocked = this.kind.time === "now_ns" || note !== undefined;
    this.timeZero_ns = 0n;
    if (note !== undefined) {
      const text = note.slice(timeZeroNote.length);
      if (!/^\d+$/.test(text)) {
        this.#csv.fail(`the note "${note}" above has no time in nanoseconds`);
      }
      this.timeZero_ns = BigInt(text);
    }
  }

  #timeOfRow() {
    const value = this.#values[this.timeColumn];
    if (typeof value === "bigint") {
      return value;
    }
    return /** @type {bigint} */ (this.timeZero_ns) + this.#offset_ns + BigInt(Math.round(value * 1e9));
  }

  /** Declares topics, and attaches the settings beside the recording. @param {Output} output */
  async begin(output) {
    const columns = this.#csv.columns;
    const { topic, type } = this.kind;
    this.#channel = await this.#declare(output, topic, `haptic/msg/${type}`, definitionOf(this.kind, columns));
    for (const message of this.kind.type === "TickRecord" ? motionMessages : []) {
      const indices = message.columns.map((column) => columns.indexOf(column));
      if (!indices.includes(-1) && this.exchange >= 0) {
        const channel = await this.#declare(output, message.topic, message.type, message.definition);
        this.#motion.push({ channel, columns: indices, write: message.write });
      }
    }
    const settings = this.name.replace(/\.csv$/, ".config.toml");
    if (this.kind.type === "TickRecord" && settings !== this.name && existsSync(settings)) {
      await this.#attach(output, settings);
    }
  }

  /** @param {Output} output @param {string} topic @param {string} type @param {string} definition */
  async #declare(output, topic, type, definition) {
    const schemaId = await output.writer.registerSchema({
      name: type,
      encoding: "ros2msg",
      data: new TextEncoder().encode(definition),
    });
    return output.writer.registerChannel({
      topic: `${this.prefix}/${topic}`,
      schemaId,
      messageEncoding: "cdr",
      metadata: new Map([
        ["offered_qos_profiles", ""],
        ["recording", basename(this.name)],
      ]),
    });
  }

  /** @param {Output} output @param {string} file */
  async #attach(output, file) {
    let data;
    try {
      data = readFileSync(file);
    } catch (error) {
      throw new UserError(`${file}: cannot be read: ${reason(error)}`);
    }
    await output.writer.addAttachment({
      name: basename(file),
      mediaType: "application/toml",
      logTime: this.first_ns,
      createTime: 0n,
      data,
    });
  }

  /** Writes the current row. @param {Output} output */
  async write(output) {
    const cdr = new CdrWriter({ buffer: this.#buffer });
    this.#values.forEach((value, k) => {
      if (typeof value === "number") {
        cdr.float64(value);
      } else if (this.#types[k] === "int64") {
        cdr.int64(value);
      } else {
        cdr.uint64(value);
      }
    });
    await this.#add(output, this.#channel, cdr);
    // What the loop published after this tick; before the first answer of the board it knew no pose.
    if (this.#values[this.exchange] === 0n) {
      this.#latch_ns = this.time_ns;
    }
    for (const message of this.#latch_ns === undefined ? [] : this.#motion) {
      const cdr = new CdrWriter({ buffer: this.#buffer });
      const latch_ns = /** @type {bigint} */ (this.#latch_ns);
      cdr
        .int32(Number(latch_ns / 1_000_000_000n))
        .uint32(Number(latch_ns % 1_000_000_000n))
        .string(this.frameId);
      message.write(
        cdr,
        message.columns.map((column) => Number(this.#values[column])),
      );
      await this.#add(output, message.channel, cdr);
    }
    this.rows += 1;
  }

  /** @param {Output} output @param {number} channelId @param {CdrWriter} cdr */
  async #add(output, channelId, cdr) {
    const time = /** @type {bigint} */ (this.time_ns);
    await output.writer.addMessage({
      channelId,
      sequence: this.rows,
      logTime: time,
      publishTime: time,
      data: cdr.data,
    });
  }

  /** Keeps the notes, which are known once all has been read. @param {Output} output */
  async end(output) {
    await output.writer.addMetadata({
      name: basename(this.name),
      metadata: new Map([
        ["topic", `${this.prefix}/${this.kind.topic}`],
        ["columns", this.#csv.columns.join(",")],
        ["rows", String(this.rows)],
        ["notes", this.#csv.notes.join("\n")],
        ["clock", this.clocked ? "rt-core's now_ns" : "scene time"],
      ]),
    });
    this.#csv.close();
  }
}
