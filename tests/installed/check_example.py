#!/usr/bin/env python3
"""Builds an example against an installed libhaptic and runs it with rt-core on the emulated device, as its README says.

Two witnesses beside the example: an observer of its contact frames, and rt-core's recording of what the hand felt. For any
example the felt force is stiffness times depth, in each tick, for the plane of the frame that rt-core had. Then comes what
the README of this example says. The first second or two do not count: rt-core fades the force in.
"""
import argparse
import csv
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from statistics import median

sys.dont_write_bytecode = True  # nothing is written to the source tree
from libhaptic import ContactFrame, find_library, load

SECONDS = 4.0  # for which the example runs
COUNTED_TICKS = 2000
# The strings' tensions are multiples of a DAC code: 0.01 N at the hand. Errors are medians, because a busy machine may not
# let the example run for a while.
FORCE_ERROR_N = 0.03


class Tick:
    """A line of rt-core's recording, with the plane that it rendered."""

    def __init__(self, row: dict[str, str], frames: dict[int, tuple]):
        self.now_ns = int(row["now_ns"])
        self.position = [float(row[name]) for name in ("x_m", "y_m", "z_m")]
        self.force = [float(row[name]) for name in ("made_fx_n", "made_fy_n", "made_fz_n")]
        self.plane = frames.get(int(row["frame_sequence"]))

    def depth_m(self) -> float:
        _, normal, offset, velocity, time_ns = self.plane
        here = sum(n * x for n, x in zip(normal, self.position))
        return max(0.0, offset + velocity * 1e-9 * (self.now_ns - time_ns) - here)

    def error_n(self) -> float:
        """Of the felt force against stiffness times depth along the normal."""
        stiffness, normal = self.plane[0], self.plane[1]
        return math.dist(self.force, [stiffness * self.depth_m() * n for n in normal])


def observe(haptic, observer, frame, frames: dict[int, tuple]) -> None:
    while (found := haptic.haptic_contact_observer_next(observer, frame, haptic.haptic_now_ns())) == 1:
        plane = frame.proxies[0].planes[0]
        if frame.proxies[0].plane_count > 0:
            frames[frame.sequence] = (frame.stiffness, list(plane.normal), plane.offset, plane.velocity, frame.plane_time_ns)
    if found < 0:
        sys.exit(haptic.haptic_last_error().decode())


def build(source: Path, prefix: Path, work: Path) -> Path:
    name = source.name
    strict = "-Wall -Wextra -Wpedantic -Werror"
    environment = {**os.environ, "CFLAGS": strict, "CXXFLAGS": strict}
    for command in (["cmake", "-G", "Ninja", "-S", source, "-B", work / name, f"-DCMAKE_PREFIX_PATH={prefix}",
                     "-DCMAKE_BUILD_TYPE=Release", "--fresh"], ["cmake", "--build", work / name]):
        done = subprocess.run(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        if done.returncode:
            sys.exit(f"failed: {' '.join(map(str, command))}\n{done.stdout}")
    return work / name / name.split("-", 1)[1]


def run(source: Path, program: Path, prefix: Path, rt_core: Path) -> list[Tick]:
    """Runs both; returns the ticks whose frame was observed."""
    haptic = load(find_library(prefix))
    session = f"example-{os.getpid()}"
    record, log = program.parent / "rt-core.csv", program.parent / "rt-core.log"
    hand = source / "hand.csv"
    command = [rt_core, "run", "--session", session, "--duration", "60", "--record", record]
    command += ["--hand", hand] if hand.exists() else []

    frames: dict[int, tuple] = {}
    frame = ContactFrame()
    observer = haptic.haptic_contact_observer_open(session.encode())
    with open(log, "w") as output:
        example = subprocess.Popen([program, session, str(SECONDS)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        loop = subprocess.Popen(command, stdout=output, stderr=subprocess.STDOUT)
        try:
            while example.poll() is None:
                observe(haptic, observer, frame, frames)
                time.sleep(0.001)
            loop.send_signal(signal.SIGINT)
            loop.wait(10)
        finally:
            for process in (example, loop):
                if process.poll() is None:
                    process.kill()
    haptic.haptic_contact_observer_close(observer)
    said = example.stdout.read()
    if example.returncode or loop.returncode:
        sys.exit(f"{source.name} ended with {example.returncode}, rt-core with {loop.returncode}:\n{said}\n{log.read_text()}")
    with open(record) as file:
        ticks = [Tick(row, frames) for row in csv.DictReader(file)]
    # After the last frame rt-core fades the force out.
    end_ns = max((time_ns for *_, time_ns in frames.values()), default=0)
    return [tick for tick in ticks if tick.plane and tick.now_ns < end_ns][-COUNTED_TICKS:]


def push_a_plane(ticks: list[Tick]) -> dict[str, tuple[float, float, float]]:
    felt = median(tick.force[1] for tick in ticks[-500:])
    return {"force at 4 mm, of 500 N/m, N": (felt, 2.0, 0.02)}


def moving_wall(ticks: list[Tick]) -> dict[str, tuple[float, float, float]]:
    # The wall as a function of time, and not as its frames say: between two frames rt-core moves it on. Without its
    # velocity the force follows at 1 N/s, and never reaches a third of what it is at the top.
    errors, at_the_top = [], []
    for tick in ticks:
        wall = 0.005 * math.sin(2 * math.pi * 1e-9 * tick.now_ns)
        if wall - tick.position[2] > 0.0001:
            errors.append(abs(tick.force[2] - 300 * (wall - tick.position[2])))
        if wall > 0.0049:
            at_the_top.append(tick.force[2])
    return {"force at the top, of 300 N/m and 5 mm, N": (median(at_the_top or [0.0]), 1.49, 0.05),
            "error against the wall's motion, N": (median(errors), 0.0, FORCE_ERROR_N)}


def another_simulator(ticks: list[Tick]) -> dict[str, tuple[float, float, float]]:
    depth = median(tick.depth_m() for tick in ticks[-500:])
    felt = median(tick.force[1] for tick in ticks[-500:])
    yielded = -median(tick.plane[2] for tick in ticks[-500:])
    return {"force of 300 N/m, N": (felt, 300 * depth, 0.02),
            "how far the sheet gives way to 10 mm, mm": (1e3 * yielded, 6.3, 0.5)}


CHECKS = {"01-push-a-plane": push_a_plane, "02-moving-wall": moving_wall, "08-another-simulator": another_simulator}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("name", choices=CHECKS)
    parser.add_argument("--prefix", type=Path, required=True)
    parser.add_argument("--rt-core", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--examples", type=Path, default=Path(__file__).resolve().parents[2] / "shared/examples")
    arguments = parser.parse_args()

    source = arguments.examples / arguments.name
    program = build(source, arguments.prefix.resolve(), arguments.work.resolve())
    ticks = run(source, program, arguments.prefix, arguments.rt_core)
    touching = [tick for tick in ticks if tick.depth_m() > 0.001]
    if len(touching) < 500:
        sys.exit(f"only {len(touching)} of {len(ticks)} ticks were deeper than 1 mm")
    figures = {"error against stiffness times depth, N": (median(tick.error_n() for tick in touching), 0.0, FORCE_ERROR_N)}
    figures |= CHECKS[arguments.name](ticks)
    missed = False
    for what, (found, expected, tolerance) in figures.items():
        held = abs(found - expected) <= tolerance
        missed = missed or not held
        print(f"{'ok  ' if held else 'MISS'} {what}: {found:.4f}, expected {expected:.4f} +- {tolerance:g}")
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
