"""Parameter studies: a function of parameters, run for every combination of their values, as one table.

    from haptic import Simulation, study

    def catch(material, stiffness):
        sim = Simulation("cloth-drop", {"model.material": material, "coupling.stiffness": stiffness}, verify=True)
        run = sim.run()
        return {"peak_n": -run.hand_force[:, 1].min(), "escapes": run.crossings.sum()}

    if __name__ == "__main__":
        study.main(catch, material=["silk", "cotton"], stiffness=[10, 20, 40])

That is a program: `python3 catch.py --out catch.csv` makes the six runs on all processors, each run on one of them;
`--machines lab1,lab2` on those of other machines, which have the same script at the same path and the package haptic.
GNU parallel (Debian's package `parallel`) distributes the runs, over ssh to other machines. Nothing is lost when a run fails
or the program is stopped: `--resume` makes only what is missing.
"""
import argparse
import csv
import hashlib
import itertools
import json
import os
import shlex
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ._core import __version__

__all__ = ["main"]

_Row = dict[str, Any]


def main(function: Callable[..., Mapping[str, Any]], **parameters: Iterable[Any]) -> None:
    """Runs the study as this program's arguments say, and ends the program: with status 1 if a run failed.

    function    called with one value of each parameter; returns the columns of a row, as numbers or texts
    parameters  values of each: numbers, texts, or true and false
    """
    runs = [dict(zip(parameters, values)) for values in itertools.product(*map(list, parameters.values()))]
    if not runs:
        raise ValueError("a study needs at least one value for each parameter")
    script = Path(sys.argv[0]).resolve()
    # What is the same on all machines that take part.
    origin = hashlib.sha256(__version__.encode() + script.read_bytes() + repr(runs).encode()).hexdigest()[:16]
    options = _arguments(function, len(runs))
    if options.run is not None:
        sys.exit(_run_one(function, runs, options, origin))
    sys.exit(_run_all(runs, options, origin, script))


def _arguments(function: Callable[..., Any], runs: int) -> argparse.Namespace:
    about = (function.__doc__ or "").strip().split("\n")[0]
    parser = argparse.ArgumentParser(description=f"{about} A study of {runs} runs.".strip())
    parser.add_argument("--out", metavar="FILE.csv", help="write the table there [print it]")
    parser.add_argument("--jobs", type=int, metavar="N", help="runs at a time on each machine [one per processor]")
    parser.add_argument("--machines", metavar="NAMES",
                        help="run on these machines, by ssh, separated by commas; ':' is this one [:]")
    parser.add_argument("--resume", action="store_true", help="keep the rows that FILE.csv.rows has from an earlier start")
    # Of a single run, as GNU parallel starts it.
    for name in ("--run", "--slot"):
        parser.add_argument(name, type=int, help=argparse.SUPPRESS)
    parser.add_argument("--origin", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.resume and not options.out:
        parser.error("--resume needs --out")
    if options.jobs is not None and options.jobs < 1:
        parser.error("--jobs must be at least 1")
    return options


def _run_one(function: Callable[..., Mapping[str, Any]], runs: Sequence[_Row], options: argparse.Namespace,
             origin: str) -> int:
    machine = os.uname().nodename
    if options.origin != origin:
        print(f"error: {machine} has another version of {sys.argv[0]} or of the package haptic ({__version__})", file=sys.stderr)
        return 2
    # One processor for each run: more threads would only compete.
    processors = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {processors[(options.slot - 1) % len(processors)]})
    # The function may print: that goes to the error output, the row alone to the output.
    output = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    parameters = runs[options.run]
    begin = time.perf_counter()
    try:
        result = dict(function(**parameters))
        if shared := set(result) & {*parameters, "machine", "seconds"}:
            raise ValueError(f"the result must not have the columns {', '.join(sorted(shared))}: they are the study's")
    except Exception as error:
        print(f"error: run {_text(parameters)}: {type(error).__name__}: {error}", file=sys.stderr)
        return 1
    row = {"run": options.run, "row": {**parameters, **result, "machine": machine,
                                       "seconds": round(time.perf_counter() - begin, 3)}}
    output.write(json.dumps(row, default=_plain) + "\n")
    output.close()
    return 0


def _plain(value: Any) -> Any:
    """Numbers of numpy as Python's."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a result must be a number or a text, found {type(value).__name__}")


def _run_all(runs: Sequence[_Row], options: argparse.Namespace, origin: str, script: Path) -> int:
    if not shutil.which("parallel"):
        print("error: GNU parallel is not installed: apt install parallel", file=sys.stderr)
        return 1
    rows: dict[int, _Row] = {}
    kept = Path(options.out + ".rows") if options.out else None
    if kept and options.resume and kept.exists():
        rows = _kept_rows(kept, runs)
    elif kept:
        kept.write_text("")
    missing = [run for run in range(len(runs)) if run not in rows]
    if missing:
        _distribute(missing, rows, len(runs), options, origin, script, kept)
    _write_table([rows[run] for run in sorted(rows)], options.out)
    failed = [runs[run] for run in range(len(runs)) if run not in rows]
    for parameters in failed:
        print(f"no result: {_text(parameters)}", file=sys.stderr)
    if failed:
        print(f"error: {len(failed)} of {len(runs)} runs have no result" +
              ("; --resume makes them" if options.out else ""), file=sys.stderr)
    elif kept:
        kept.unlink()
    return 1 if failed else 0


def _kept_rows(kept: Path, runs: Sequence[_Row]) -> dict[int, _Row]:
    """The rows of an earlier start, as far as their parameters are those of today."""
    rows: dict[int, _Row] = {}
    for line in kept.read_text().splitlines():
        try:
            found = json.loads(line)
            run, row = int(found["run"]), found["row"]
        except (ValueError, KeyError, TypeError):
            continue  # the line that was being written
        today = json.loads(json.dumps(runs[run], default=_plain)) if run < len(runs) else None
        if today is None or any(row.get(name) != value for name, value in today.items()):
            raise SystemExit(f"error: {kept} is of another study; remove it, or start without --resume")
        rows[run] = row
    return rows


def _distribute(missing: Sequence[int], rows: dict[int, _Row], all_runs: int, options: argparse.Namespace, origin: str,
                script: Path, kept: Path | None) -> None:
    """Runs what is missing by GNU parallel, and takes each row as it comes."""
    command = ["parallel", "--plain", "--will-cite", "--line-buffer"]
    command += ["--jobs", str(options.jobs) if options.jobs else "100%"]
    if options.machines:
        command += ["--sshlogin", options.machines, "--workdir", os.getcwd()]
        if "PYTHONPATH" in os.environ:
            command += ["--env", "PYTHONPATH"]
    command += [f"{shlex.quote(sys.executable)} {shlex.quote(str(script))} --run {{}} --slot {{%}} --origin {origin}"]
    terminal = sys.stderr.isatty()
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as parallel:
        assert parallel.stdin and parallel.stdout
        parallel.stdin.write("".join(f"{run}\n" for run in missing))
        parallel.stdin.close()
        for line in parallel.stdout:
            found = json.loads(line)
            rows[found["run"]] = found["row"]
            if kept:
                with kept.open("a") as file:
                    file.write(line)
            if terminal:
                print(f"\r{script.stem}: {len(rows)} of {all_runs} ", end="", file=sys.stderr, flush=True)
    if terminal:
        print("\r\033[K", end="", file=sys.stderr)


def _write_table(rows: Sequence[_Row], out: str | None) -> None:
    columns = list(dict.fromkeys(name for row in rows for name in row))
    with open(out, "w", newline="") if out else os.fdopen(os.dup(1), "w", newline="") as file:
        writer = csv.DictWriter(file, columns, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)


def _text(parameters: _Row) -> str:
    return ", ".join(f"{name}={value}" for name, value in parameters.items())
