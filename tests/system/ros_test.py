#!/usr/bin/env python3
"""The device as ROS 2's nodes see it: ros_test.py RT-CORE HOST-SIM ROS-LISTENER

A hand of the emulated device presses a block of gel, with the simulation on the same machine. The relay publishes each
tick, and a client of another DDS, Fast DDS, finds all topics by ROS 2's names and types and reads them; each message is
compared with rt-core's own recording. A second client sends a wrench overlay all the time: it does nothing where
rt-core takes none, pushes within its bounds where it does, and its push fades when the client is killed.
"""
import bisect
import csv
import os
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from pressing import expect, write_hand

RT_CORE, HOST_SIM, LISTENER = sys.argv[1:4]
SESSION = f"ros-{os.getpid()}"
DOMAIN = str(100 + os.getpid() % 100)
TOPICS = {
    "rt/lab/left/pose": "geometry_msgs::msg::dds_::PoseStamped_",
    "rt/lab/left/twist": "geometry_msgs::msg::dds_::TwistStamped_",
    "rt/lab/left/wrench": "geometry_msgs::msg::dds_::WrenchStamped_",
    "rt/lab/left/joy": "sensor_msgs::msg::dds_::Joy_",
    "rt/diagnostics": "diagnostic_msgs::msg::dds_::DiagnosticArray_",
}
FRAME = "lab_left_device"
# Columns of the recording with the values of a message, in its order.
COLUMNS = {
    "pose": ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"],
    "twist": ["vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"],
    "wrench": ["made_fx_n", "made_fy_n", "made_fz_n", "made_tx_nm", "made_ty_nm", "made_tz_nm"],
}
OVERLAY_FLAG = 1 << 16
TIMEOUT_NS, RAMP_NS = 50e6, 100e6  # defaults of overlay.timeout_s and overlay.ramp_s


def start_relay(duration: int) -> subprocess.Popen:
    return subprocess.Popen([RT_CORE, "relay", "--session", SESSION, "--domain", DOMAIN, "--ros", "lab/left", "--ros-rate", "1000",
                             "--ros-overlay", "--duration", str(duration)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def start_sender(force: list[str]) -> subprocess.Popen:
    return subprocess.Popen([LISTENER, DOMAIN, "60", "lab/left", *force])


def run(recording: Path, duration: int, *options: str) -> list[dict[str, str]]:
    subprocess.run([RT_CORE, "run", "--session", SESSION, "--duration", str(duration), "--record", str(recording), *options], check=True,
                   capture_output=True)
    with recording.open() as file:
        return list(csv.DictReader(file))


def end(*processes: subprocess.Popen) -> None:
    for process in processes:
        process.kill()
        process.wait()


class Recording:
    """Rows of a recording by the times of the wall clock that messages carry."""

    def __init__(self, rows: list[dict[str, str]]) -> None:
        wall_ns = time.time_ns() - time.monotonic_ns()
        self.rows = rows
        self.times = [int(row["now_ns"]) + wall_ns for row in rows]

    def near(self, stamp: int) -> list[dict[str, str]]:
        """The tick, whose time differs by what the clock was adjusted since, and its neighbours."""
        k = bisect.bisect(self.times, stamp)
        return self.rows[max(0, k - 3):k + 3]

    def has(self, stamp: int, columns: list[str], values: list[float]) -> bool:
        return any([float(row[column]) for column in columns] == values for row in self.near(stamp))


def check_device(lines: dict[str, list[list[str]]], recording: Recording) -> None:
    for topic, columns in COLUMNS.items():
        messages = lines[topic]
        stamps = [int(message[0]) for message in messages]
        expect(f"{topic}: stamps grow from one to the next", len(stamps) > 1000 and stamps == sorted(set(stamps)), len(stamps))
        ticks = sorted(b - a for a, b in zip(stamps, stamps[1:]))
        expect(f"{topic}: there is one for each tick, ms", 0.9e6 < ticks[len(ticks) // 2] < 1.1e6, ticks[len(ticks) // 2] / 1e6)
        expect(f"{topic}: the frame is named after the topics", {message[1] for message in messages} == {FRAME})
        wrong = sum(not recording.has(int(stamp), columns, [float(value) for value in values]) for stamp, _, *values in messages)
        expect(f"{topic}: to the last bit what rt-core recorded; wrong", wrong == 0, wrong, len(messages))
    expect("the hand moved, N and m/s", max(float(m[3]) for m in lines["wrench"]) > 0.5 and max(abs(float(m[3])) for m in lines["twist"]) > 0.01,
           max(float(m[3]) for m in lines["wrench"]), max(abs(float(m[3])) for m in lines["twist"]))
    wrong = 0
    for stamp, _, axes, *buttons in lines["joy"]:
        held = sum(1 << k for k, button in enumerate(buttons) if button == "1")
        wrong += len(buttons) != 3 or axes != "0" or not any(int(row["buttons"]) == held for row in recording.near(int(stamp)))
    held = {tuple(message[3:]) for message in lines["joy"]}
    expect("joy: three buttons as recorded, held and not", wrong == 0 and {("0", "0", "0"), ("1", "0", "1")} <= held, wrong, held)


def check_diagnostics(messages: list[str]) -> None:
    heard = []
    of_session = set()
    for message in messages:
        _, level, name, state, hardware, *values = message.split("|")
        of_session.add((name, hardware))
        heard.append((level, state, dict(value.split("=", 1) for value in values)))
    expect("diagnostics: of this session's device", of_session == {(f"haptic: session {SESSION}", "spidar-g6")}, of_session)
    running = [values for level, state, values in heard if (level, state) == ("0", "running")]
    expect("diagnostics: about one a second, and running meanwhile", 5 <= len(heard) <= 16 and len(running) >= 4, [h[:2] for h in heard])
    expect("diagnostics: overlays are counted", int(running[-1]["overlays passed on"]) > 500 and running[-1]["overlays refused"] == "0", running[-1])
    expect("diagnostics: the rendered stiffness is named", float(running[-1]["rendered stiffness, N/m"]) > 10.0)
    expect("diagnostics: stale after the run", heard[-1][:2] == ("3", "no rt-core"), heard[-1])


def hear_the_device(work: Path) -> None:
    hand = write_hand(HOST_SIM, work, buttons=0b101)
    heard = work / "heard.txt"  # more than a pipe holds
    relay = start_relay(16)
    simulation = subprocess.Popen([HOST_SIM, "run", "gel-block", "--clock", "real", "--session", SESSION, "--wait", "10", "--duration", "0"],
                                  stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    pushing = start_sender(["2", "0", "0"])
    with heard.open("w") as out:
        listener = subprocess.Popen([LISTENER, DOMAIN, "13", "lab/left"], stdout=out)
    try:
        rows = run(work / "rt.csv", 8, "--hand", str(hand))
        listener.wait(30)
        said = relay.communicate(timeout=30)[0]
    finally:
        end(relay, simulation, listener, pushing)
    print(said.strip().splitlines()[-1])
    lines = {topic: [] for topic in ("topic", "pose", "twist", "wrench", "joy")}
    diagnostics = []
    for line in heard.read_text().splitlines():
        topic, rest = line.split(" ", 1)
        if topic == "diagnostics":
            diagnostics.append(rest)
        else:
            lines[topic].append(rest.split())
    found = dict(lines["topic"])
    expect("every topic has ROS 2's name and type", TOPICS.items() <= found.items(), found)
    check_device(lines, Recording(rows))
    check_diagnostics(diagnostics)
    pushed = [row for row in rows if row["overlay_read"] != "-1" or int(row["flags"]) & OVERLAY_FLAG]
    expect("no overlay is taken by default", len(rows) > 7000 and not pushed, len(pushed))


def feel_the_overlay(work: Path) -> None:
    """3 N are asked for and 0.5 N are allowed; the sender is killed after some seconds."""
    relay = start_relay(12)
    pushing = start_sender(["0", "0", "-3"])
    # rt-core is started, armed and runs for some seconds meanwhile.
    killer = threading.Timer(4.0, pushing.kill)
    killer.start()
    try:
        rows = run(work / "pushed.csv", 6, "--set", "overlay.max_force=0.5", "--set", "overlay.max_torque=0.01")
    finally:
        killer.cancel()
        end(relay, pushing)
    force = [tuple(float(row[f"f{axis}_n"]) for axis in "xyz") for row in rows]
    expect("the overlay pushes with what its setting allows, N", abs(min(f[2] for f in force) + 0.5) < 1e-9, min(f[2] for f in force))
    expect("and in its own direction", all(f[0] == 0.0 and f[1] == 0.0 and f[2] <= 0.0 for f in force))
    made = [float(row["made_fz_n"]) for row in rows if float(row["fz_n"]) < -0.499]
    expect("the strings make it for seconds, N", len(made) > 1000 and all(abs(f + 0.5) < 0.05 for f in made), len(made), min(made), max(made))
    last_ns = max(int(row["overlay_time_ns"]) for row in rows)
    after = [(int(row["now_ns"]) - last_ns, float(row["fz_n"])) for row in rows if int(row["now_ns"]) > last_ns]
    expect("the killed sender falls silent before the end, s", after[-1][0] > 0.5e9, after[-1][0] / 1e9)
    # Two ticks for the last one before it was read, and for lateness.
    gone_ns = next(age for age, _ in after if all(f == 0.0 for a, f in after if a >= age))
    expect("the push is gone after timeout and ramp, s", TIMEOUT_NS < gone_ns, gone_ns / 1e9)
    late_ns = sum(max(0, int(row["period_us"].split(".")[0]) - 2000) for row in rows) * 1e3
    expect("and not later", gone_ns < TIMEOUT_NS + RAMP_NS + 5e6 + late_ns, gone_ns / 1e9, late_ns / 1e9)


def main() -> None:
    refused = subprocess.run([RT_CORE, "relay", "--ros", "2left", "--duration", "1"], capture_output=True, text=True)
    expect("a name that ROS 2 does not allow is refused", refused.returncode != 0 and "2left" in refused.stderr, refused.stderr.strip())
    with tempfile.TemporaryDirectory() as work:
        hear_the_device(Path(work))
        feel_the_overlay(Path(work))


if __name__ == "__main__":
    main()
