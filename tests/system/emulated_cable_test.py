#!/usr/bin/env python3
"""The emulated cable between two network namespaces: emulated_cable_test.py EMULATED-CABLE

Datagrams with their number and time of sending go over it. Needs root for the namespaces; exit status 77 without.
"""
import subprocess
import sys

from pressing import expect
from two_machines import BOX, DESK, inside, machines, possible

CABLE = sys.argv[1]
# Prints number and latency, us, of what arrives; ends a second after the last.
RECEIVE = """
import socket, struct, time
inlet = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
inlet.setsockopt(socket.SOL_SOCKET, 33, 4 << 20)  # SO_RCVBUFFORCE: holds all of them, however late this runs
inlet.bind(("10.99.0.2", 5000))
print("listening", flush=True)
inlet.settimeout(10)
try:
    while True:
        number, sent = struct.unpack("qq", inlet.recv(100))
        print(number, (time.monotonic_ns() - sent) // 1000)
        inlet.settimeout(1)
except TimeoutError:
    pass
"""
SEND = """
import socket, struct, time
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for number in range(2000):
    out.sendto(struct.pack("qq", number, time.monotonic_ns()), ("10.99.0.2", 5000))
    time.sleep(0.0005)
"""


def arrivals(*options: str) -> list[tuple[int, int]]:
    with machines([CABLE, *options]):
        receiver = subprocess.Popen(inside(DESK, sys.executable, "-c", RECEIVE), stdout=subprocess.PIPE, text=True)
        try:
            receiver.stdout.readline()
            subprocess.run(inside(BOX, sys.executable, "-c", SEND), check=True)
            lines = receiver.communicate(timeout=30)[0].splitlines()
        finally:
            receiver.kill()
    return [tuple(map(int, line.split())) for line in lines]


def main() -> None:
    if not possible():
        print("namespaces cannot be made here")
        sys.exit(77)
    wrong = subprocess.run([CABLE, f"{BOX}-none", f"{DESK}-none"], capture_output=True, text=True)
    expect("a namespace that is not there is named", wrong.returncode == 1 and f"{BOX}-none" in wrong.stderr, wrong.stderr.strip())

    plain = arrivals("--delay", "20")
    latencies = sorted(latency for _, latency in plain)
    expect("without loss all arrive, in order", [number for number, _ in plain] == list(range(2000)), len(plain))
    # Later by what a busy machine takes; ten times as late would be another delay.
    expect("none arrives before the delay, and half not long after it, us", latencies[0] >= 20000 and latencies[1000] < 200000,
           latencies[0], latencies[1000])

    jittered = arrivals("--delay", "20", "--jitter", "10")
    latencies = sorted(latency for _, latency in jittered)
    numbers = [number for number, _ in jittered]
    # A quarter of them is sent for less than 15 ms, and a quarter for more than 25 ms.
    expect("jitter makes some earlier and some later, by its size at most, and reorders them, us",
           len(numbers) == 2000 and numbers != sorted(numbers) and 10000 <= latencies[0] < 20000 and latencies[1500] > 20000,
           latencies[0], latencies[1500])

    # 1400 of 2000 arrive, five standard deviations of 20.5 to either side.
    lossy = arrivals("--loss", "30", "--seed", "7")
    expect("three in ten are lost", abs(len(lossy) - 1400) < 103, len(lossy))


if __name__ == "__main__":
    main()
