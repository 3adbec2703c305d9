// The MCAP file: written under a temporary name beside its own, which it gets once it is complete.
import { closeSync, existsSync, openSync, renameSync, rmSync, writeSync } from "node:fs";
import zstd from "@foxglove/wasm-zstd";
import { McapWriter } from "@mcap/core";
import { UserError, reason } from "./csv.mjs";

// Uncompressed. The index has an entry for each chunk, and a reader holds one chunk.
const chunkBytes = 4 << 20;
const stopSignals = /** @type {const} */ (["SIGINT", "SIGTERM", "SIGHUP"]);

export class Output {
  #stop = () => {
    this.discard();
    process.exit(130);
  };

  /** @param {string} name @param {() => void} onWrite called after each chunk */
  static async open(name, onWrite) {
    await zstd.isLoaded;
    const output = new Output(name, onWrite);
    await output.writer.start({ profile: "ros2", library: "haptic" });
    return output;
  }

  /** @param {string} name @param {() => void} onWrite */
  constructor(name, onWrite) {
    this.name = name;
    this.bytes = 0;
    this.part = `${name}.${process.pid}.part`;
    try {
      this.fd = openSync(this.part, "wx");
    } catch (error) {
      throw new UserError(
        `${name} cannot be written: ${reason(error)}; name a file in a folder of yours with --out FILE.mcap`,
      );
    }
    for (const signal of stopSignals) {
      process.once(signal, this.#stop);
    }
    this.writer = new McapWriter({
      chunkSize: chunkBytes,
      compressChunk: (data) => ({ compression: "zstd", compressedData: zstd.compress(data, 1) }),
      writable: {
        position: () => BigInt(this.bytes),
        write: async (data) => {
          this.#write(data);
          onWrite();
          await new Promise(setImmediate); // signals are delivered only here
        },
      },
    });
  }

  /** @param {Uint8Array} data */
  #write(data) {
    try {
      for (let done = 0; done < data.length; ) {
        const written = writeSync(this.fd, data, done);
        done += written;
        this.bytes += written;
      }
    } catch (error) {
      throw new UserError(`${this.name} cannot be written: ${reason(error)}; name another file with --out FILE.mcap`);
    }
  }

  /** Completes the file and gives it its name. */
  async finish() {
    await this.writer.end();
    if (existsSync(this.name)) {
      throw new UserError(`${this.name} was made by another program meanwhile: name another file with --out`);
    }
    closeSync(this.fd);
    renameSync(this.part, this.name);
    this.#ignoreSignals();
  }

  /** Leaves nothing. */
  discard() {
    // A signal that meets a failing write comes here twice.
    rmSync(this.part, { force: true });
    this.#ignoreSignals();
  }

  #ignoreSignals() {
    for (const signal of stopSignals) {
      process.removeListener(signal, this.#stop);
    }
  }
}
