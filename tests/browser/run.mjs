// Runs one file of tests and says what each has proved: run.mjs FILE. Status 77, which ctest knows as skipped, without a browser.
import { run } from "./claims.mjs";
import { pathToFileURL } from "node:url";

if (!process.env.CHROMIUM || process.env.CHROMIUM.endsWith("-NOTFOUND")) {
  console.log("skipped: CMake found no chromium (toolchain/setup test installs it, cmake --fresh looks again)");
  process.exit(77);
}
await import(pathToFileURL(process.argv[2]));
process.exit((await run()) ? 0 : 1);
