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
`--stiffness 15 30` takes other values for a parameter. GNU parallel (Debian's package `parallel`) distributes the runs, over
ssh to other machines. Nothing is lost when a run fails or the program is stopped: `--resume` makes only what is missing.

A function may also run a program: report_of(["host-sim", "run", ...]) returns its report.
"""
from __future__ import annotations

import argparse
import csv
import hashlib
import inspect
import itertools
import json
import math
import os
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Union

import numpy as np

from ._core import __version__

__all__ = ["main", "output_of", "report_of"]

_Row = dict[str, Any]
_Result = Union[Mapping[str, Any], Iterable[Mapping[str, Any]]]

# Names that parameters cannot have: of options, and of columns that the study adds.
_OPTIONS = ("help", "out", "jobs", "machines", "resume", "run", "slot", "origin")
_COLUMNS = ("machine", "seconds")


def main(function: Callable[..., _Result], *, alone: Callable[..., bool] | None = None,
         **parameters: Iterable[Any]) -> list[_Row]:
    """Runs the study as this program's arguments say and returns the table's rows; ends the program if a run failed.

    function    called with one value of each parameter; returns the columns of a row, numbers or texts, or several such
                rows. Arguments of the program after -- come first, as texts: def function(*arguments, stiffness)
    alone       called like function; true for a run beside which its machine must do no other, because it measures times;
                it has all processors
    parameters  values of each: numbers, texts, or true and false
    """
    if taken := set(parameters) & {*_OPTIONS, *_COLUMNS}:
        raise ValueError(f"a study cannot have a parameter named {', '.join(sorted(taken))}: that is the study's own")
    own, arguments = _divided(sys.argv[1:])
    # As they arrive on another machine.
    values = {name: json.loads(json.dumps(list(of), default=_plain)) for name, of in parameters.items()}
    if not all(values.values()):
        raise ValueError("a study needs at least one value for each parameter")
    parser = _parser(function, values)
    options = parser.parse_args(own)
    script = Path(sys.argv[0]).resolve()
    # What is the same on all machines that take part.
    origin = hashlib.sha256(__version__.encode() + script.read_bytes()).hexdigest()[:16]
    if options.run is not None:
        sys.exit(_run_one(function, options, origin))
    if arguments and not _takes_arguments(function):
        parser.error("this study takes no arguments after --")
    if options.resume and not options.out:
        parser.error("--resume needs --out")
    if options.jobs is not None and options.jobs < 1:
        parser.error("--jobs must be at least 1")
    chosen = {name: getattr(options, name) for name in values}
    combinations = itertools.product(*chosen.values())
    runs: list[_Row] = [{"parameters": dict(zip(chosen, one)), "arguments": arguments} for one in combinations]
    single = [alone is not None and alone(*arguments, **run["parameters"]) for run in runs]
    return _run_all(runs, single, options, origin, script)


def output_of(command: Sequence[str | os.PathLike[str]], *, statuses: Collection[int] = (0,)) -> str:
    """Runs a program to its end and returns what it printed.

    command   name or path, and arguments
    statuses  with which it may end. After any other a RuntimeError has the command and the last lines of its error output
    """
    ended = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if ended.returncode not in statuses:
        raise _failure(ended)
    return ended.stdout


def report_of(command: Sequence[str | os.PathLike[str]], *, statuses: Collection[int] = (0,)) -> dict[str, Any]:
    """Runs a program that writes a JSON report, as `host-sim run` and `rt-core run` do, and returns the report.

    command   name or path, and arguments, without --report
    statuses  with which it may end, as for output_of()
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "report.json")
        ended = subprocess.run([*command, "--report", file], stdin=subprocess.DEVNULL, capture_output=True, text=True,
                               check=False)
        # A status may have several meanings, but only a complete run has a report.
        if ended.returncode not in statuses or not file.exists():
            raise _failure(ended)
        return dict(json.loads(file.read_text()))


def _failure(ended: subprocess.CompletedProcess[str]) -> RuntimeError:
    said = "\n".join((ended.stderr or ended.stdout).splitlines()[-5:])
    return RuntimeError(f"{shlex.join(map(str, ended.args))} ended with status {ended.returncode}:\n{said}")


def _divided(arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The arguments before and after --."""
    end = arguments.index("--") if "--" in arguments else len(arguments)
    return list(arguments[:end]), list(arguments[end + 1:])


def _takes_arguments(function: Callable[..., _Result]) -> bool:
    return any(p.kind is p.VAR_POSITIONAL for p in inspect.signature(function).parameters.values())


def _parser(function: Callable[..., _Result], values: Mapping[str, list[Any]]) -> argparse.ArgumentParser:
    about = (function.__doc__ or "").strip().split("\n")[0]
    runs = math.prod(len(of) for of in values.values())
    more = " [-- ARGUMENT ...]" if _takes_arguments(function) else ""
    parser = argparse.ArgumentParser(description=f"{about} A study of {runs} runs.".strip(), allow_abbrev=False,
                                     usage=f"%(prog)s [OPTION ...]{more}")
    parser.add_argument("--out", metavar="FILE.csv", help="write the table there [print it]")
    parser.add_argument("--jobs", type=int, metavar="N", help="runs at a time on each machine [one per processor]")
    parser.add_argument("--machines", metavar="NAMES",
                        help="run on these machines, by ssh, separated by commas; ':' is this one [:]")
    parser.add_argument("--resume", action="store_true",
                        help="keep the rows that FILE.csv.rows has from an earlier start")
    group = parser.add_argument_group("parameters", "Each option takes one or more values.")
    for name, of in values.items():
        # A percent sign would be a format of argparse.
        default = " ".join(map(str, of)).replace("%", "%%")
        group.add_argument(f"--{name.replace('_', '-')}", dest=name, metavar="VALUE", nargs="+", type=_reader(of),
                           default=of, help=f"[{default}]")
    # Of a single run, as GNU parallel starts it.
    parser.add_argument("--run", type=json.loads, help=argparse.SUPPRESS)
    parser.add_argument("--slot", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--origin", help=argparse.SUPPRESS)
    return parser


def _reader(values: Sequence[Any]) -> Callable[[str], Any]:
    """Reads a value that is like these from the command line."""
    def number(text: str) -> float:
        try:
            return int(text)
        except ValueError:
            return float(text)

    def truth(text: str) -> bool:
        if text not in ("true", "false"):
            raise ValueError
        return text == "true"

    if all(isinstance(value, bool) for value in values):
        return truth
    if all(isinstance(value, (int, float)) for value in values):
        return number
    return str


def _run_one(function: Callable[..., _Result], options: argparse.Namespace, origin: str) -> int:
    machine = os.uname().nodename
    if options.origin != origin:
        print(f"error: {machine} has another version of {sys.argv[0]} or of the package haptic ({__version__})",
              file=sys.stderr)
        return 2
    # One processor for each run beside which there are others: more threads would only compete.
    if options.slot > 0:
        processors = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {processors[(options.slot - 1) % len(processors)]})
    # The function may print: that goes to the error output, the row alone to the output.
    output = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    parameters = options.run["parameters"]
    begin = time.perf_counter()
    try:
        result = function(*options.run["arguments"], **parameters)
        results = [dict(row) for row in ([result] if isinstance(result, Mapping) else result)]
        if shared := {name for row in results for name in row} & {*parameters, *_COLUMNS}:
            raise ValueError(f"the result must not have the columns {', '.join(sorted(shared))}: they are the study's")
    except Exception as error:
        print(f"error: run {_text(parameters)}: {type(error).__name__}: {error}", file=sys.stderr)
        return 1
    where = dict(zip(_COLUMNS, (machine, round(time.perf_counter() - begin, 3))))
    rows = [{**parameters, **row, **where} for row in results]
    output.write(json.dumps({**options.run, "rows": rows}, default=_plain) + "\n")
    output.close()
    return 0


def _plain(value: Any) -> Any:
    """Numbers of numpy as Python's."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a result must be a number or a text, found {type(value).__name__}")


def _run_all(runs: Sequence[_Row], single: Sequence[bool], options: argparse.Namespace, origin: str,
             script: Path) -> list[_Row]:
    if not shutil.which("parallel"):
        raise SystemExit("error: GNU parallel is not installed: apt install parallel")
    rows: dict[int, list[_Row]] = {}
    kept = Path(options.out + ".rows") if options.out else None
    if kept and options.resume and kept.exists():
        rows = _kept_rows(kept, runs)
    elif kept:
        kept.write_text("")
    # Those that must be alone follow the others.
    for one_at_a_time in (False, True):
        missing = [run for run in range(len(runs)) if run not in rows and single[run] == one_at_a_time]
        if missing:
            jobs, slot = (1, "0") if one_at_a_time else (options.jobs, "{%}")
            _distribute(missing, runs, rows, jobs, slot, options.machines, origin, script, kept)
    table = [row for run in sorted(rows) for row in rows[run]]
    _write_table(table, options.out)
    failed = [run["parameters"] for number, run in enumerate(runs) if number not in rows]
    for parameters in failed:
        print(f"no result: {_text(parameters)}", file=sys.stderr)
    if failed:
        raise SystemExit(f"error: {len(failed)} of {len(runs)} runs have no result" +
                         ("; --resume makes them" if options.out else ""))
    if kept:
        kept.unlink()
    return table


def _kept_rows(kept: Path, runs: Sequence[_Row]) -> dict[int, list[_Row]]:
    """The rows of an earlier start, as far as it made the same runs."""
    rows: dict[int, list[_Row]] = {}
    for line in kept.read_text().splitlines():
        try:
            found = json.loads(line)
            run, of_run = int(found["number"]), found["rows"]
        except (ValueError, KeyError, TypeError):
            continue  # the line that was being written
        if run >= len(runs) or any(found[what] != runs[run][what] for what in ("parameters", "arguments")):
            raise SystemExit(f"error: {kept} is of another study; remove it, or start without --resume")
        rows[run] = of_run
    return rows


def _distribute(missing: Sequence[int], runs: Sequence[_Row], rows: dict[int, list[_Row]], jobs: int | None, slot: str,
                machines: str | None, origin: str, script: Path, kept: Path | None) -> None:
    """Runs what is missing by GNU parallel, and takes each row as it comes."""
    command = ["parallel", "--plain", "--will-cite", "--line-buffer", "--jobs", str(jobs) if jobs else "100%"]
    if machines:
        command += ["--sshlogin", machines, "--workdir", os.getcwd()]
        if "PYTHONPATH" in os.environ:
            command += ["--env", "PYTHONPATH"]
    command += [f"{shlex.quote(sys.executable)} {shlex.quote(str(script))} --run {{}} --slot {slot} --origin {origin}"]
    terminal = sys.stderr.isatty()
    # In a file: while a pipe to parallel is full, nobody would read what it prints, and both would wait.
    with tempfile.TemporaryFile("w+") as waiting:
        waiting.writelines(json.dumps({"number": run, **runs[run]}) + "\n" for run in missing)
        waiting.seek(0)
        with subprocess.Popen(command, stdin=waiting, stdout=subprocess.PIPE, text=True) as parallel:
            assert parallel.stdout
            for line in parallel.stdout:
                found = json.loads(line)
                rows[found["number"]] = found["rows"]
                if kept:
                    with kept.open("a") as file:
                        file.write(line)
                if terminal:
                    print(f"\r{script.stem}: {len(rows)} of {len(runs)} ", end="", file=sys.stderr, flush=True)
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
