#!/usr/bin/env python3
"""Compiles Haptic.cs with Mono, and compares each field that it writes, and where it reads, with libhaptic's structures."""
import argparse
import os
import re
import subprocess
import sys
from pathlib import Path

sys.dont_write_bytecode = True  # nothing is written to the source tree
from libhaptic import ContactFrame, DeviceState, expect, find_library, load

HERE = Path(__file__).resolve().parent
HAPTIC = HERE.parents[1] / "shared/examples/11-csharp/Haptic.cs"
REFUSED = ["session name", "step_ns|step", "0 to 63", "0 to 3"]


def check_frame(frame: ContactFrame) -> None:
    expect("the frame's head", [frame.state_sequence, frame.state_time_ns, frame.plane_time_ns, frame.step_ns,
                                frame.stiffness, frame.torque_stiffness, frame.dynamic_friction, frame.static_friction,
                                frame.body_work, frame.flags, frame.proxy_count], [*range(11, 20), 1, 64])
    for i, proxy in enumerate(frame.proxies):
        first = [*proxy.rest_offset, *proxy.position, *proxy.rest_velocity, *proxy.surface_velocity]
        expect(f"proxy {i}", first, [100.0 * i + k for k in range(12)])
        expect(f"radius of proxy {i}", proxy.radius, 0.125 * i + 0.0625)
        expect(f"counts of proxy {i}", (proxy.in_contact, proxy.plane_count), (2, 3))
        for p, plane in enumerate(proxy.planes):
            expect(f"plane {p} of proxy {i}", (list(plane.normal), plane.offset, plane.velocity),
                   ([float(k == p) for k in range(3)], 100.0 * i + 12 + 2 * p, 100.0 * i + 13 + 2 * p))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--prefix", type=Path, required=True)
    parser.add_argument("--work", type=Path, required=True)
    options = parser.parse_args()
    options.work.mkdir(parents=True, exist_ok=True)
    program = options.work / "Fields.exe"
    subprocess.run(["mcs", "-warnaserror", "-langversion:7", str(HERE / "Fields.cs"), str(HAPTIC), f"-out:{program}"], check=True)

    library = find_library(options.prefix)
    haptic = load(library)
    session = f"csharp-{os.getpid()}"
    with subprocess.Popen(["mono", str(program), session], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                          env={**os.environ, "LD_LIBRARY_PATH": str(library.parent)}) as fields:
        lines = []
        for line in fields.stdout:
            lines.append(line.strip())
            if line.startswith("published"):
                break
        observer = haptic.haptic_contact_observer_open(session.encode())
        frame = ContactFrame()
        found = haptic.haptic_contact_observer_next(observer, frame, haptic.haptic_now_ns())
        haptic.haptic_contact_observer_close(observer)
        fields.stdin.close()
        lines += [line.strip() for line in fields.stdout]
    expect("Fields.exe's status", fields.returncode, 0)
    expect("the number of frames", (found, frame.sequence), (1, 1))
    check_frame(frame)

    offsets = dict(re.findall(r"^field (\w+) (\d+)$", "\n".join(lines), re.MULTILINE))
    fields_of_state = {name: getattr(DeviceState, name).offset for name, _ in DeviceState._fields_}
    written = {re.sub(r"(?<!^)([A-Z])", r"_\1", name).lower(): int(offset) for name, offset in offsets.items()}
    expect("the layout of DeviceState", written, fields_of_state)
    refused = [line for line in lines if line.startswith(("refused", "accepted"))]
    for line, pattern in zip(refused, [*REFUSED, "0 to 63"], strict=True):
        if not re.search(f"^refused .*({pattern})", line):
            sys.exit(f"error: \"{line}\" should name {pattern}")


if __name__ == "__main__":
    main()
