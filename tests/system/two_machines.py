"""Sessions of rt-core and a simulation on one machine and on two, which are network namespaces joined by a cable.

The second machine has a time namespace too, in which its monotonic clock is 5000 s ahead: a plane whose time is not
converted would never be rendered.
"""
import contextlib
import csv
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

AHEAD_S = 5000
NAME = f"haptic-{os.getpid()}"
BOX, DESK = f"{NAME}-box", f"{NAME}-desk"


def sh(command: str) -> None:
    subprocess.run(command, shell=True, check=True)


def possible() -> bool:
    """Whether this process may make namespaces."""
    made = f"unshare --net --time --fork true && ip netns add {NAME} && ip netns del {NAME}"
    return os.geteuid() == 0 and subprocess.run(made, shell=True, capture_output=True).returncode == 0


def inside(machine: str, *command: str) -> list[str]:
    """A command in a machine's network. That of ip itself works only where / is a mount point, as that of a chroot is not."""
    return ["nsenter", f"--net=/run/netns/{machine}", *command]


@contextlib.contextmanager
def machines(emulated_cable: Sequence[str] = ()) -> Iterator[None]:
    """Two namespaces with an interface "cable" each: a veth pair, or what the program emulated_cable makes of its options."""
    ends = [f"h{os.getpid()}a", f"h{os.getpid()}b"]  # names of interfaces have 15 characters at most
    cable = None
    try:
        for machine in (BOX, DESK):
            sh(f"ip netns add {machine}")
        if emulated_cable:
            cable = subprocess.Popen([emulated_cable[0], BOX, DESK, *emulated_cable[1:]], stdout=subprocess.PIPE, text=True)
            if cable.stdout.readline() != "ready\n":
                sys.exit("error: there is no emulated cable")
        else:
            sh(f"ip link add {ends[0]} type veth peer name {ends[1]}")
            for machine, end in ((BOX, ends[0]), (DESK, ends[1])):
                sh(f"ip link set {end} netns {machine} name cable")
        addresses = {BOX: ("10.99.0.1", "02:00:00:00:00:01"), DESK: ("10.99.0.2", "02:00:00:00:00:02")}
        for machine, other in ((BOX, DESK), (DESK, BOX)):
            within = " ".join(inside(machine))
            # Only what the session sends goes over the cable: no address is asked for, and no router.
            sh(f"{within} sysctl -q -w net.ipv6.conf.all.disable_ipv6=1")
            sh(f"{within} ip link set cable address {addresses[machine][1]}")
            sh(f"{within} ip addr add {addresses[machine][0]}/24 dev cable")
            sh(f"{within} ip link set cable up")
            sh(f"{within} ip neigh replace {addresses[other][0]} lladdr {addresses[other][1]} dev cable nud permanent")
            sh(f"{within} ip link set lo up")
        yield
    finally:
        if cable:
            cable.terminate()
            cable.communicate()
        for machine in (BOX, DESK):
            subprocess.run(["ip", "netns", "del", machine], capture_output=True)
        subprocess.run(["ip", "link", "del", ends[0]], capture_output=True)


def on(machine: str, *command: str) -> list[str]:
    clock = ["unshare", "--time", "--monotonic", str(AHEAD_S), "--fork", "--kill-child"] if machine == DESK else []
    return inside(machine, *clock, *command)


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

    def stop(self, name: str) -> None:
        if name in self.running and self.running[name].poll() is None:
            os.killpg(self.running[name].pid, signal.SIGINT)
            self.running[name].wait(20)

    def end(self) -> None:
        for process in self.running.values():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


@dataclass
class Session:
    """rt-core with an emulated device whose hand follows a file, and a simulation of a scene."""
    rt_core: str
    host_sim: str
    scene: str
    hand: Path
    seconds: float  # how long the loop runs
    loop_options: list[str] = field(default_factory=list)
    simulation_options: list[str] = field(default_factory=list)
    loop_first_s: float = -1.0  # the loop starts so long before the simulation; negative: after it

    def run(self, folder: Path, linked: bool, during: Callable[[Processes], None] = lambda processes: None) -> Processes:
        """Runs both to the loop's end, on one machine or on two; `during` is called once both run. Writes rt.csv and rt.json."""
        processes = Processes(folder)
        name = f"{NAME}-{folder.name}"
        loop = [self.rt_core, "run", "--session", name, "--hand", str(self.hand), "--duration", str(self.seconds),
                "--record", str(folder / "rt.csv"), "--report", str(folder / "rt.json"), *self.loop_options]
        simulation = [self.host_sim, "run", self.scene, "--clock", "real", "--session", name, "--wait", "10", "--duration", "0",
                      "--verify", *self.simulation_options]
        if linked:
            loop, simulation = on(BOX, *loop), on(DESK, *simulation, "--dds", "cable")
        starts = [("rt-core", loop), ("host-sim", simulation)]
        try:
            if linked:
                processes.start("relay", on(BOX, self.rt_core, "relay", "--session", name, "--interface", "cable"))
            first, second = starts if self.loop_first_s > 0.0 else reversed(starts)
            processes.start(*first)
            time.sleep(abs(self.loop_first_s))  # meanwhile the relays find each other
            processes.start(*second)
            during(processes)
            rt_core = processes.running["rt-core"]
            if rt_core.wait(60) != 0:
                sys.exit(f"error: rt-core ended with {rt_core.returncode}:\n{processes.log('rt-core')}\n{processes.log('host-sim')}")
            processes.stop("host-sim")
            processes.stop("relay")
        finally:
            processes.end()
        return processes


def recorded(recording: Path, *columns: str) -> list[tuple[float, ...]]:
    """These columns of a recording of rt-core, row by row."""
    with recording.open() as file:
        return [tuple(float(row[column]) for column in columns) for row in csv.DictReader(file)]
