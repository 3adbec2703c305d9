// Runs one test file and reports each claim: run.mjs FILE. Exits with 77, which ctest treats as skipped, if there is no
// browser.
import { run } from "./claims.mjs";
import { pathToFileURL } from "node:url";

if (!process.env.CHROMIUM || process.env.CHROMIUM.endsWith("-NOTFOUND")) {
  console.log("skipped: CMake found no chromium (toolchain/setup test installs it, cmake --fresh looks again)");
  process.exit(77);
}
await import(pathToFileURL(process.argv[2]));
process.exit((await run()) ? 0 : 1);
