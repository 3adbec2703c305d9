#!/usr/bin/env python3
"""The device as ROS 2's nodes see it: ros_test.py RT-CORE HOST-SIM ROS-LISTENER

A hand of the emulated device presses a block of gel, with the simulation on the same machine. The relay publishes each
tick, and a client of another DDS, Fast DDS, finds all topics by ROS 2's names and types and reads the wrenches; each is
one of rt-core's own recording.
"""
import bisect
import csv
import os
import subprocess
import sys
import tempfile
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


def main() -> None:
    refused = subprocess.run([RT_CORE, "relay", "--ros", "2left", "--duration", "1"], capture_output=True, text=True)
    expect("a name that ROS 2 does not allow is refused", refused.returncode != 0 and "2left" in refused.stderr, refused.stderr.strip())

    with tempfile.TemporaryDirectory() as work:
        recording = Path(work, "rt.csv")
        hand = write_hand(HOST_SIM, Path(work))
        relay = subprocess.Popen([RT_CORE, "relay", "--session", SESSION, "--domain", DOMAIN, "--ros", "lab/left", "--ros-rate", "1000",
                                  "--duration", "12"], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        simulation = subprocess.Popen([HOST_SIM, "run", "gel-block", "--clock", "real", "--session", SESSION, "--wait", "10",
                                       "--duration", "0"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        heard = Path(work, "heard.txt")  # more than a pipe holds
        with heard.open("w") as out:
            listener = subprocess.Popen([LISTENER, DOMAIN, "10", "lab/left"], stdout=out)
        try:
            subprocess.run([RT_CORE, "run", "--session", SESSION, "--hand", str(hand), "--duration", "8", "--record", str(recording)], check=True,
                           capture_output=True)
            listener.wait(30)
            lines = heard.read_text().splitlines()
            said = relay.communicate(timeout=30)[0]
        finally:
            for process in (relay, simulation, listener):
                process.kill()
                process.wait()
        wall_ns = time.time_ns() - time.monotonic_ns()
        with recording.open() as file:
            made = [(int(row["now_ns"]) + wall_ns, float(row["fy_n"])) for row in csv.DictReader(file)]

    found = dict(line.split()[1:] for line in lines if line.startswith("topic "))
    expect("every topic has ROS 2's name and type", TOPICS.items() <= found.items(), found)
    wrenches = [line.split()[1:] for line in lines if line.startswith("wrench ")]
    expect("the client reads wrenches", len(wrenches) > 100, len(wrenches), said.strip().splitlines()[-1])
    stamps = [int(wrench[0]) for wrench in wrenches]
    expect("stamps grow from one to the next", stamps == sorted(set(stamps)))
    ticks = sorted(b - a for a, b in zip(stamps, stamps[1:]))
    expect("there is one for each tick, ms", 0.9e6 < ticks[len(ticks) // 2] < 1.1e6, ticks[len(ticks) // 2] / 1e6)
    expect("the frame is named after the topics", {wrench[1] for wrench in wrenches} == {"lab_left_device"})
    # What the motors make differs from what was asked by the steps of their converters.
    felt = [float(wrench[3]) for wrench in wrenches]
    times = [at for at, _ in made]
    wrong = 0
    for at, force in zip(stamps, felt):
        k = bisect.bisect(times, at)
        wrong += not any(abs(asked - force) < 0.02 for _, asked in made[max(0, k - 3):k + 3])
    expect("forces and times are those of rt-core's recording; N at most", max(felt) > 0.5 and wrong < 0.01 * len(felt), max(felt), wrong)


if __name__ == "__main__":
    main()
