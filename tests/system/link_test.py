#!/usr/bin/env python3
"""A session over two machines: link_test.py RT-CORE HOST-SIM

The machines are namespaces (two_machines.py). A hand of the emulated device presses a block of gel and holds:

  on one machine and on two, the hand feels the same
  while the cable is out, the force fades to nothing; once it is in again, it returns
  when the simulation is killed, the force fades, and the relay says that it is gone

Needs root for the namespaces; exit status 77 without.
"""
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pressing import PRESSED_S, expect, write_hand
from two_machines import AHEAD_S, DESK, Processes, Session, inside, machines, possible, recorded

RT_CORE, HOST_SIM = sys.argv[1:3]
SECONDS = 7.0


def between(force: list[tuple[float, ...]], begin: float, end: float) -> list[float]:
    return [f for t, f in force if begin <= t < end]


def median(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]


def main() -> None:
    if not possible():
        print("namespaces cannot be made here")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as work, machines():
        session = Session(RT_CORE, HOST_SIM, "gel-block", write_hand(HOST_SIM, Path(work)), SECONDS)

        def felt(name: str, linked: bool = True, during=lambda processes: None) -> tuple[list[tuple[float, ...]], Processes]:
            """Time since the loop runs, s, and vertical force at the hand, N."""
            folder = Path(work, name)
            folder.mkdir()
            processes = session.run(folder, linked, during)
            return recorded(folder / "rt.csv", "time_s", "fy_n"), processes

        alone, _ = felt("alone", linked=False)
        linked, processes = felt("linked")
        held = [median(between(each, 4.0, 6.0)) for each in (alone, linked)]
        expect("the hand feels the same on two machines as on one, N", held[0] > 0.5 and abs(held[1] - held[0]) < 0.05 * held[0],
               *(round(f, 3) for f in held))
        clock = re.search(r"the other clock is (\S+) s ahead, within (\d+) us", processes.log("host-sim"))
        expect("the offset of the clocks is found, s, us", clock is not None and abs(float(clock[1]) + AHEAD_S) < 0.01 and
               int(clock[2]) < 5000, *(clock.groups() if clock else (processes.log("host-sim"),)))
        expect("nothing escapes and no message is refused", "escapes          0" in processes.log("host-sim") and
               " 0 refused, 0 late" in processes.log("relay"), processes.log("relay").strip().splitlines()[-1])

        def pull_the_cable(_) -> None:
            time.sleep(4.0)
            subprocess.run(inside(DESK, "ip", "link", "set", "cable", "down"), check=True)
            time.sleep(1.0)
            subprocess.run(inside(DESK, "ip", "link", "set", "cable", "up"), check=True)

        pulled, _ = felt("pulled", during=pull_the_cable)
        lowest = min(between(pulled, PRESSED_S + 0.5, SECONDS - 1.0))
        back = median(between(pulled, SECONDS - 0.6, SECONDS - 0.3))
        expect("a pulled cable fades the force, which returns, N", abs(lowest) < 0.05 and abs(back - held[0]) < 0.1 * held[0],
               round(lowest, 3), round(back, 3))

        def kill_the_simulation(running: Processes) -> None:
            time.sleep(4.5)
            os.killpg(running.running["host-sim"].pid, signal.SIGKILL)

        killed, processes = felt("killed", during=kill_the_simulation)
        expect("a killed simulation fades the force, N", max(map(abs, between(killed, SECONDS - 0.6, SECONDS - 0.3))) < 0.05 and
               max(between(killed, 3.0, 4.0)) > 0.5, round(max(map(abs, between(killed, SECONDS - 0.6, SECONDS - 0.3))), 4))
        expect("the relay says that it is gone", "the simulation is gone" in processes.log("relay"))


if __name__ == "__main__":
    main()
