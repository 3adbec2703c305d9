// Reads recordings of any length row by row, as haptic/csv.hpp does: notes (#), a header, rows of numbers.
import { closeSync, fstatSync, openSync, readSync } from "node:fs";

const chunkBytes = 1 << 20;

/** A problem with what the user gave; its text says what, where, and what to do. */
export class UserError extends Error {}

/** @param {unknown} error of a system call @returns {string} its reason, without the call */
export function reason(error) {
  const text = /** @type {Error} */ (error).message ?? String(error);
  return text.replace(/^[A-Z0-9]+: /, "").replace(/, \w+( '.*')?$/, "");
}

/** Notes, columns and rows of one file. */
export class CsvFile {
  /** @type {string[]} without # */
  notes = [];
  /** @type {string[]} */
  columns = [];
  /** Number of the line last read. */
  line = 0;
  /** Bytes read. */
  read = 0;
  /** Whether the last line had no end, as a killed run leaves it; it is not a row. */
  torn = false;

  #fd;
  #text = "";
  #position = 0;
  #ended = false;
  #chunk = Buffer.alloc(chunkBytes);

  /** @param {string} name */
  constructor(name) {
    this.name = name;
    try {
      this.#fd = openSync(name, "r");
      const status = fstatSync(this.#fd);
      if (status.isDirectory()) {
        throw new Error("is a directory");
      }
      this.size = status.size;
    } catch (error) {
      throw new UserError(`${name}: cannot be read: ${reason(error)}; give what --record has written`);
    }
    const header = this.#nextContent();
    if (header === undefined) {
      this.fail(
        this.torn
          ? "the header is cut off: the run was killed before its first row"
          : "is empty: give what --record has written",
      );
    }
    this.columns = header.split(",").map((cell) => cell.trim());
  }

  /** @param {string} problem @returns {never} */
  fail(problem) {
    throw new UserError(`${this.name}:${Math.max(this.line, 1)}: ${problem}`);
  }

  /** Cells of the next row; undefined at the end. @returns {string[] | undefined} */
  next() {
    const line = this.#nextContent();
    if (line === undefined) {
      return undefined;
    }
    const cells = line.split(",");
    if (cells.length !== this.columns.length) {
      this.fail(`has ${cells.length} cells, the header has ${this.columns.length}: delete the line, or record again`);
    }
    // What Number() takes beyond decimal numbers: 0x10, Infinity, blanks.
    if (/[^0-9eE+\-.,]|,,|^,|,$/.test(line)) {
      const column = cells.findIndex((cell) => !/^[0-9eE+\-.]+$/.test(cell));
      this.refuse(column, cells[column], "a finite number");
    }
    return cells;
  }

  /** @param {number} column @param {string} cell @param {string} wanted @returns {never} */
  refuse(column, cell, wanted) {
    this.fail(`column ${this.columns[column]}: "${cell}" is not ${wanted}: delete the line, or record again`);
  }

  close() {
    closeSync(this.#fd);
  }

  /** The next line that is neither blank nor a note. */
  #nextContent() {
    for (let line = this.#nextLine(); line !== undefined; line = this.#nextLine()) {
      if (line.startsWith("#")) {
        this.notes.push(Buffer.from(line.slice(1), "latin1").toString("utf8").trim());
      } else if (line !== "") {
        return line;
      }
    }
    return undefined;
  }

  /** @returns {string | undefined} */
  #nextLine() {
    let end = this.#text.indexOf("\n", this.#position);
    while (end < 0 && !this.#ended) {
      const bytes = readSync(this.#fd, this.#chunk, 0, chunkBytes, null);
      this.#ended = bytes === 0;
      this.read += bytes;
      // Bytes, not characters: numbers are ASCII, and notes are decoded one by one.
      this.#text = this.#text.slice(this.#position) + this.#chunk.toString("latin1", 0, bytes);
      this.#position = 0;
      end = this.#text.indexOf("\n");
    }
    if (end < 0) {
      this.torn = this.#text.slice(this.#position).trim() !== "";
      return undefined;
    }
    this.line += 1;
    const line = this.#text.slice(this.#position, end).trim();
    this.#position = end + 1;
    return line;
  }
}
