#!/usr/bin/env python3
"""A session over two machines: link_test.py RT-CORE HOST-SIM

The machines are network namespaces, joined by a cable (a veth pair). The simulation's has a time namespace as well, in
which its monotonic clock is 5000 s ahead: a plane whose time is not converted would never be rendered. A hand of the
emulated device presses a block of gel and holds:

  on one machine and on two, the hand feels the same
  while the cable is out, the force fades to nothing; once it is in again, it returns
  when the simulation is killed, the force fades, and the relay says that it is gone

Needs root for the namespaces; exit status 77 without.
"""
import contextlib
import csv
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from pressing import PRESSED_S, expect, write_hand

RT_CORE, HOST_SIM = sys.argv[1:3]
AHEAD_S = 5000
NAME = f"haptic-{os.getpid()}"
BOX, DESK = f"{NAME}-box", f"{NAME}-desk"
SECONDS = 7.0


def sh(command: str) -> None:
    subprocess.run(command, shell=True, check=True)


@contextlib.contextmanager
def machines():
    """Two namespaces with an interface "cable" each. Names of interfaces have 15 characters at most."""
    ends = [f"h{os.getpid()}a", f"h{os.getpid()}b"]
    try:
        for machine in (BOX, DESK):
            sh(f"ip netns add {machine}")
        sh(f"ip link add {ends[0]} type veth peer name {ends[1]}")
        for machine, end, address in ((BOX, ends[0], "10.99.0.1"), (DESK, ends[1], "10.99.0.2")):
            sh(f"ip link set {end} netns {machine} name cable")
            sh(f"ip -n {machine} addr add {address}/24 dev cable")
            sh(f"ip -n {machine} link set cable up")
            sh(f"ip -n {machine} link set lo up")
        yield
    finally:
        for machine in (BOX, DESK):
            subprocess.run(["ip", "netns", "del", machine], capture_output=True)
        subprocess.run(["ip", "link", "del", ends[0]], capture_output=True)


def in_namespace(machine: str, *command: str) -> list[str]:
    clock = ["unshare", "--time", "--monotonic", str(AHEAD_S), "--fork", "--kill-child"] if machine == DESK else []
    return ["ip", "netns", "exec", machine, *clock, *command]


class Processes:
    """What runs during one session; ended with it."""

    def __init__(self, folder: Path):
        self.folder, self.running = folder, {}

    def start(self, name: str, command: list[str]) -> subprocess.Popen:
        with open(self.folder / f"{name}.log", "w") as log:
            self.running[name] = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, start_new_session=True)
        return self.running[name]

    def log(self, name: str) -> str:
        return (self.folder / f"{name}.log").read_text()

    def end(self) -> None:
        for process in self.running.values():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def forces(recording: Path) -> list[tuple[float, float]]:
    """Time since the loop runs, s, and vertical force at the hand, N."""
    with recording.open() as file:
        return [(float(row["time_s"]), float(row["fy_n"])) for row in csv.DictReader(file)]


def between(force: list[tuple[float, float]], begin: float, end: float) -> list[float]:
    return [f for t, f in force if begin <= t < end]


def median(values: list[float]) -> float:
    return sorted(values)[len(values) // 2]


def session(folder: Path, hand: Path, linked: bool, during=lambda processes: None) -> tuple[list[tuple[float, float]], Processes]:
    """Runs the loop and a simulation; `during` is called once both run."""
    processes = Processes(folder)
    name = f"{NAME}-{folder.name}"
    loop = [RT_CORE, "run", "--session", name, "--hand", str(hand), "--duration", str(SECONDS), "--record", str(folder / "rt.csv")]
    simulation = [HOST_SIM, "run", "gel-block", "--clock", "real", "--session", name, "--wait", "10", "--duration", "0", "--verify"]
    try:
        if linked:
            processes.start("relay", in_namespace(BOX, RT_CORE, "relay", "--session", name, "--interface", "cable"))
            processes.start("host-sim", in_namespace(DESK, *simulation, "--dds", "cable"))
            time.sleep(1.0)  # until the relays have found each other
            rt_core = processes.start("rt-core", in_namespace(BOX, *loop))
        else:
            processes.start("host-sim", simulation)
            time.sleep(1.0)
            rt_core = processes.start("rt-core", loop)
        during(processes)
        if rt_core.wait(60) != 0:
            sys.exit(f"error: rt-core ended with {rt_core.returncode}:\n{processes.log('rt-core')}\n{processes.log('host-sim')}")
        for each in ("host-sim", "relay"):
            if each in processes.running and processes.running[each].poll() is None:
                os.killpg(processes.running[each].pid, signal.SIGINT)
                processes.running[each].wait(20)
    finally:
        processes.end()
    return forces(folder / "rt.csv"), processes


def main() -> None:
    possible = f"unshare --net --time --fork true && ip netns add {NAME} && ip netns del {NAME}"
    if os.geteuid() != 0 or subprocess.run(possible, shell=True, capture_output=True).returncode:
        print("namespaces cannot be made here")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as work, machines():
        def folder(name: str) -> Path:
            made = Path(work, name)
            made.mkdir()
            return made

        hand = write_hand(HOST_SIM, Path(work))
        alone, _ = session(folder("alone"), hand, linked=False)
        linked, processes = session(folder("linked"), hand, linked=True)
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
            sh(f"ip -n {DESK} link set cable down")
            time.sleep(1.0)
            sh(f"ip -n {DESK} link set cable up")

        pulled, _ = session(folder("pulled"), hand, linked=True, during=pull_the_cable)
        lowest = min(between(pulled, PRESSED_S + 0.5, SECONDS - 1.0))
        back = median(between(pulled, SECONDS - 0.6, SECONDS - 0.3))
        expect("a pulled cable fades the force, which returns, N", abs(lowest) < 0.05 and abs(back - held[0]) < 0.1 * held[0],
               round(lowest, 3), round(back, 3))

        def kill_the_simulation(running: Processes) -> None:
            time.sleep(4.5)
            os.killpg(running.running["host-sim"].pid, signal.SIGKILL)

        killed, processes = session(folder("killed"), hand, linked=True, during=kill_the_simulation)
        expect("a killed simulation fades the force, N", max(map(abs, between(killed, SECONDS - 0.6, SECONDS - 0.3))) < 0.05 and
               max(between(killed, 3.0, 4.0)) > 0.5, round(max(map(abs, between(killed, SECONDS - 0.6, SECONDS - 0.3))), 4))
        expect("the relay says that it is gone", "the simulation is gone" in processes.log("relay"))


if __name__ == "__main__":
    main()
