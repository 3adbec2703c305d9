#!/usr/bin/env python3
"""Recordings as MCAP: mcap_test.py RT-CORE HOST-SIM TOOLCHAIN-FOLDER

Both processes record a hand that presses a block of gel. toolchain/mcap makes one file of all recordings, which a reader
that follows the specification alone checks and reads back: every number of every row to the last bit, the motion as ROS 2
has it, the notes and settings, and one time base. Then what is no recording, or is damaged, is refused and leaves nothing.

Exit status 77 where node, npm's packages or zstd are missing.
"""
import csv
import os
import resource
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
from decimal import ROUND_HALF_EVEN, Decimal
from pathlib import Path

import mcap_reader
from pressing import expect, write_hand

RT_CORE, HOST_SIM, TOOLCHAIN = sys.argv[1:4]
SESSION = f"mcap-{os.getpid()}"
INTEGERS = {"int64": "<q", "uint64": "<Q"}


def convert(*arguments, **options) -> subprocess.CompletedProcess:
    return subprocess.run([TOOLCHAIN + "/mcap", *map(str, arguments)], capture_output=True, text=True, **options)


def skip_if_missing(folder: Path) -> None:
    for program in ("node", "npm", "zstd"):
        if shutil.which(program) is None:
            print(f"skipped: no {program}")
            sys.exit(77)
    if "npm could not fetch" in (said := convert(folder / "none.csv").stderr):
        print("skipped:", said)
        sys.exit(77)


class Recording:
    """A CSV file as it was written."""

    def __init__(self, file: Path):
        lines = file.read_text().splitlines()
        self.notes = [line[1:].strip() for line in lines if line.startswith("#")]
        self.columns, *self.rows = csv.reader(line for line in lines if not line.startswith("#"))

    def column(self, name: str) -> list[str]:
        k = self.columns.index(name)
        return [row[k] for row in self.rows]

    def step_times(self) -> list[int]:
        """host-sim's times in ns, by decimal arithmetic."""
        zero, = [int(note.split()[1]) for note in self.notes if note.startswith("time-zero-ns ")] or [0]
        return [zero + int((Decimal(time_s) * 10**9).to_integral_value(ROUND_HALF_EVEN)) for time_s in self.column("time_s")]


def lines_of(file: Path) -> int:
    return file.read_bytes().count(b"\n") if file.exists() else 0


def record(folder: Path) -> None:
    hand = write_hand(HOST_SIM, folder)
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    simulation = subprocess.Popen([HOST_SIM, "run", "gel-block", "--clock", "real", "--session", SESSION, "--wait", "60", "--duration", "0",
                                   "--record", str(folder / "sim.csv")], **quiet)
    loop = subprocess.Popen([RT_CORE, "run", "--session", SESSION, "--hand", str(hand), "--record", str(folder / "rt.csv")],
                            **quiet)
    try:
        until = time.monotonic() + 100
        while min(lines_of(folder / f"rt.{kind}.csv") for kind in ("frames", "compliance")) < 250 and loop.poll() is None and time.monotonic() < until:
            time.sleep(0.2)
        for process in (loop, simulation):
            process.terminate()
            expect("a process ends when it is told to", process.wait(30) == 0)
    finally:
        for process in (loop, simulation):
            process.kill()
            process.wait()
    subprocess.run([HOST_SIM, "run", "gel-block", "--duration", "0.2", "--record", str(folder / "lockstep.csv")], check=True,
                   capture_output=True)


def same_bits(cell: str, kind: str, value) -> bool:
    if kind in INTEGERS:
        return int(cell) == value
    return struct.pack("<d", float(cell)) == struct.pack("<d", value)


def check_rows(mcap: mcap_reader.Mcap, topic: str, recording: Recording, times: list[int]) -> None:
    """Each row of a recording is a message of its topic, with every number of it to the last bit."""
    schema = mcap.schema_of(topic)
    decoder = mcap_reader.Type(schema.data.decode())
    expect(f"{topic}: the columns are the fields", [name for _, name in decoder.fields] == recording.columns, schema.name)
    messages = mcap.of_topic(topic)
    expect(f"{topic}: a message for each row", len(messages) == len(recording.rows) > 0, len(messages))
    expect(f"{topic}: times", [m.log_time for m in messages] == times)
    expect(f"{topic}: numbered", [m.sequence for m in messages] == list(range(len(messages))))
    wrong = 0
    for row, message in zip(recording.rows, messages):
        values = decoder.decode(message.data)
        wrong += sum(not same_bits(cell, kind, values[name]) for cell, (kind, name) in zip(row, decoder.fields))
    expect(f"{topic}: every number to the last bit", wrong == 0, f"{len(messages) * len(decoder.fields)} numbers")


MOTION = {  # topic: type, and the columns in the order of the message
    "pose": ("geometry_msgs/msg/PoseStamped", ["x_m", "y_m", "z_m", "qx", "qy", "qz", "qw"]),
    "twist": ("geometry_msgs/msg/TwistStamped", ["vx_m_s", "vy_m_s", "vz_m_s", "wx_rad_s", "wy_rad_s", "wz_rad_s"]),
    "wrench": ("geometry_msgs/msg/WrenchStamped", ["made_fx_n", "made_fy_n", "made_fz_n", "made_tx_nm", "made_ty_nm", "made_tz_nm"]),
}


def leaves(value) -> list:
    if isinstance(value, dict):
        return [leaf for part in value.values() for leaf in leaves(part)]
    return [value]


def check_motion(mcap: mcap_reader.Mcap, names: str, recording: Recording) -> None:
    """Pose, twist, wrench and buttons of each tick, stamped with the board's last good answer."""
    rows = [dict(zip(recording.columns, row)) for row in recording.rows]
    latch, latches = None, []
    for row in rows:
        latch = int(row["now_ns"]) if row["exchange_in"] == "0" else latch
        latches.append(latch)
    known = [k for k, latch in enumerate(latches) if latch is not None]
    for topic, (name, columns) in MOTION.items():
        schema = mcap.schema_of(f"/{names}/{topic}")
        decoder = mcap_reader.Type(schema.data.decode())
        messages = mcap.of_topic(f"/{names}/{topic}")
        wrong = schema.name != name or len(messages) != len(known)
        for k, message in zip(known, messages):
            value = decoder.decode(message.data)
            header = value.pop("header")
            numbers = leaves(value)
            wrong += header != {"stamp": {"sec": latches[k] // 10**9, "nanosec": latches[k] % 10**9}, "frame_id": names.replace("/", "_") + "_device"}
            wrong += message.log_time != int(rows[k]["now_ns"]) or len(numbers) != len(columns)
            wrong += sum(not same_bits(rows[k][column], "float64", number) for column, number in zip(columns, numbers))
        expect(f"/{names}/{topic}: the tick's, as ROS 2 has it", wrong == 0, schema.name, len(messages))
    joys = mcap.of_topic(f"/{names}/joy")
    decoder = mcap_reader.Type(mcap.schema_of(f"/{names}/joy").data.decode())
    wrong = len(joys) != len(known)
    for k, message in zip(known, joys):
        value = decoder.decode(message.data)
        buttons = int(rows[k]["buttons"])
        wrong += value["axes"] != [] or value["buttons"] != [buttons & 1, buttons >> 1 & 1, buttons >> 2 & 1]
    expect(f"/{names}/joy: the three buttons", wrong == 0, mcap.schema_of(f"/{names}/joy").name)


def check_conversion(folder: Path) -> None:
    names = ("rt", "sim", "rt.frames", "rt.compliance")
    said = convert(*(folder / f"{name}.csv" for name in names), "--names", "lab/left", "--out", folder / "all.mcap")
    expect("the recordings are converted", said.returncode == 0 and not said.stderr, said.stderr, said.stdout.strip())
    mcap = mcap_reader.read((folder / "all.mcap").read_bytes())
    expect("chunks, indices, summary and checksums are right", mcap.chunks > 1 and mcap.profile == "ros2", mcap.chunks)
    expect("a chunk is no longer than a reader can hold", mcap.largest_chunk < 5 << 20, mcap.largest_chunk)
    times = [message.log_time for message in mcap.messages]
    expect("messages are in the order of time", times == sorted(times), len(times))
    expect("each topic is CDR with a schema of ROS 2's", {(c.encoding, mcap.schemas[c.schema].encoding) for c in mcap.channels.values()} == {("cdr", "ros2msg")})

    recordings = {name: Recording(folder / f"{name}.csv") for name in names}
    rt, sim, frames, compliance = recordings.values()
    check_rows(mcap, "/lab/left/ticks", rt, [int(t) for t in rt.column("now_ns")])
    check_rows(mcap, "/lab/left/steps", sim, sim.step_times())
    check_rows(mcap, "/lab/left/frames", frames, [int(t) for t in frames.column("now_ns")])
    check_rows(mcap, "/lab/left/compliance", compliance, [int(t) for t in compliance.column("now_ns")])
    check_motion(mcap, "lab/left", rt)
    units = mcap_reader.Type(mcap.schema_of("/lab/left/ticks").data.decode()).units
    expected = {"x_m": "m", "tx_nm": "N m", "t0_n": "N", "wx_rad_s": "rad/s", "stiffness_n_m": "N/m", "compute_us": "us", "now_ns": "ns"}
    expect("fields tell their units", expected.items() <= units.items() and "qw" not in units and "flags" not in units, units)

    # Each frame that rt-core took says when the step that made it began, by rt-core's clock.
    begun = set(sim.step_times())
    taken = {int(t) for t in frames.column("plane_time_ns")}
    expect("ticks and steps have one time base, to the nanosecond", taken <= begun and len(taken) > 100, len(taken), len(begun))

    for name, recording in recordings.items():
        expect(f"{name}: notes are kept", mcap.metadata[f"{name}.csv"]["notes"] == "\n".join(recording.notes), recording.notes[:2])
    expect("the settings are attached", mcap.attachments == {"rt.config.toml": (folder / "rt.config.toml").read_bytes()})


def check_buttons_and_lost_answers(folder: Path) -> None:
    """A recording in which buttons are pressed, and in which the board at times does not answer."""
    header, *rows = (folder / "rt.csv").read_text().splitlines()[:1001]
    columns = header.split(",")
    cells = [row.split(",") for row in rows]
    for k, row in enumerate(cells):
        row[columns.index("buttons")] = str(k % 16)
        row[columns.index("exchange_in")] = "1" if k < 3 or k % 7 == 0 else "0"
    (folder / "edited.csv").write_text("\n".join([header, *map(",".join, cells), ""]))
    said = convert(folder / "edited.csv")
    expect("a recording of a bad line is converted", said.returncode == 0, said.stderr)
    check_motion(mcap_reader.read((folder / "edited.mcap").read_bytes()), "haptic", Recording(folder / "edited.csv"))


def check_options(folder: Path) -> None:
    said = convert(folder / "sim.csv", "--offset", "-0.25")
    expect("the output is named after the recording", said.returncode == 0 and (folder / "sim.mcap").exists(), said.stderr)
    moved = mcap_reader.read((folder / "sim.mcap").read_bytes()).of_topic("/haptic/steps")
    expect("another machine's times are moved", [m.log_time for m in moved] == [t - 250_000_000 for t in Recording(folder / "sim.csv").step_times()])

    said = convert(folder / "rt.csv", folder / "sim.csv", "--offset", "1000", "--out", folder / "apart.mcap")
    expect("times of another machine are told", said.returncode == 0 and "sim.csv begins after all others have ended" in said.stderr, said.stderr)

    said = convert(folder / "lockstep.csv")
    steps = mcap_reader.read((folder / "lockstep.mcap").read_bytes()).of_topic("/haptic/steps")
    expect("a run in lockstep begins at 0", said.returncode == 0 and steps[0].log_time == 0 and not said.stderr)

    shutil.copy(folder / "rt.csv", folder / "2nd.csv")
    convert(folder / "rt.csv", folder / "2nd.csv", "--out", folder / "two.mcap")
    topics = {channel.topic for channel in mcap_reader.read((folder / "two.mcap").read_bytes()).channels.values()}
    expect("two of a kind have topics of their own", topics == {f"/haptic/{name}/{topic}" for name in ("rt", "_2nd") for topic in (*MOTION, "joy", "ticks")}, topics)

    # A killed run leaves a line without its end, which may be cut within a number.
    whole = (folder / "rt.csv").read_text()
    (folder / "torn.csv").write_text(whole[:-3])
    said = convert(folder / "torn.csv")
    rows = len(mcap_reader.read((folder / "torn.mcap").read_bytes()).of_topic("/haptic/ticks"))
    expect("a line without its end is left out, and told", rows == whole.count("\n") - 2 and "torn.csv: the last line has no end" in said.stderr, said.stderr)


def check_refusals(folder: Path) -> None:
    """Each is named with file, line and remedy, and leaves no file."""
    header, *rows = (folder / "rt.csv").read_text().splitlines(keepends=True)[:6]
    columns = header.strip().split(",")

    def changed(column: str, cell: str) -> str:
        cells = rows[2].strip().split(",")
        cells[columns.index(column)] = cell
        return header + rows[0] + rows[1] + ",".join(cells) + "\n" + rows[3]

    bad = {
        "empty.csv": ("", "empty.csv:1: is empty", "--record"),
        "hand.csv": ("time_s,x_m,y_m,z_m\n0,0,0,0\n", "hand.csv:1: is no recording", "--record"),
        "picture.csv": ("\x89PNG\r\n\x1a\n\0\0", "picture.csv:1: is no recording", "--record"),
        "header.csv": (header, "header.csv:1: has no rows", "ended before"),
        "cut.csv": (header[:40], "cut.csv:1: the header is cut off", "killed"),
        "short.csv": (header + rows[0] + rows[1][:50] + "\n" + rows[2], f"short.csv:3: has {rows[1][:50].count(',') + 1} cells, the header has {len(columns)}", "delete the line"),
        "word.csv": (changed("qx", "north"), 'word.csv:4: column qx: "north" is not a finite number', "delete the line"),
        "nan.csv": (changed("vx_m_s", "-nan"), 'nan.csv:4: column vx_m_s: "-nan" is not a finite number', "delete the line"),
        "hex.csv": (changed("qx", "0x10"), 'hex.csv:4: column qx: "0x10" is not a finite number', "delete the line"),
        "gap.csv": (changed("qx", ""), 'gap.csv:4: column qx: "" is not a finite number', "delete the line"),
        "dots.csv": (changed("qx", "1.2.3"), 'dots.csv:4: column qx: "1.2.3" is not a finite number', "delete the line"),
        "half.csv": (changed("flags", "1.5"), 'half.csv:4: column flags: "1.5" is not an integer of 64 bits', "delete the line"),
        "huge.csv": (changed("faults", str(2**63)), f'huge.csv:4: column faults: "{2**63}" is not an integer', "delete the line"),
        "negative.csv": (changed("tick", "-1"), 'negative.csv:4: column tick: "-1" is not a natural number', "delete the line"),
        "back.csv": (changed("now_ns", "5"), "back.csv:4: column now_ns: the time is before that of the row above", "delete the line"),
        "lossy.csv": (changed("x_m", str(2**53 + 1)), "lossy.csv:4: column x_m: a double cannot hold 9007199254740993", "newer version"),
        "twice.csv": (header.replace("y_m", "x_m", 1) + rows[0], 'twice.csv:1: two columns are named "x_m"', "record again"),
        "capital.csv": (header.replace("y_m", "Y", 1) + rows[0], 'capital.csv:1: "Y" cannot be the name of a field', "lower-case"),
    }
    for name, (text, *words) in bad.items():
        (folder / name).write_text(text, encoding="latin1")
        expect_refusal(folder, *words, arguments=[folder / name])
    (folder / "folder.csv").mkdir()
    good = folder / "rt.csv"
    expect_refusal(folder, "absent.csv: cannot be read: no such file", "give what --record", arguments=[folder / "absent.csv"])
    expect_refusal(folder, "folder.csv: cannot be read: is a directory", "give what --record", arguments=[folder / "folder.csv"])
    expect_refusal(folder, "no recording given", "usage: toolchain/mcap", arguments=[])
    expect_refusal(folder, "--output", "usage: toolchain/mcap", arguments=[good, "--output", "x"])
    expect_refusal(folder, '--names "2left"', "none beginning with a digit", arguments=[good, "--names", "2left"])
    expect_refusal(folder, '--offset "soon"', "seconds, as in", arguments=[good, "--offset", "soon"])
    expect_refusal(folder, "all.mcap exists", "--out", arguments=[good, "--out", folder / "all.mcap"])
    expect_refusal(folder, "no such file or directory", "--out FILE.mcap", arguments=[good, "--out", folder / "nowhere/rt.mcap"])
    expect_refusal(folder, "lockstep.csv has no time in common with", "--clock real", arguments=[good, folder / "lockstep.csv"])
    expect_refusal(folder, "would both be the topic /haptic/rt/ticks", "another name", arguments=[good, good])
    expect_refusal(folder, "has no time in nanoseconds", "sim2.csv:", arguments=[with_time_zero(folder, "noon")])
    expect_refusal(folder, "the time is below zero", "--offset", arguments=[with_time_zero(folder, "0"), "--offset", "-1"])
    # Without the right to write, which root always has: as nobody, who must be able to read the scripts.
    other = {"user": 65534, "group": 65534, "extra_groups": []} if os.geteuid() == 0 else {}
    for item in (folder, good, folder / "folder.csv"):
        item.chmod(0o555)
    if subprocess.run(["test", "-r", TOOLCHAIN + "/mcap"], **other).returncode == 0:
        expect_refusal(folder, "permission denied", "--out FILE.mcap", arguments=[good], **other)
    folder.chmod(0o755)


def with_time_zero(folder: Path, text: str) -> Path:
    lines = (folder / "sim.csv").read_text().splitlines(keepends=True)
    file = folder / "sim2.csv"
    file.write_text("".join(f"# time-zero-ns {text}\n" if line.startswith("# time-zero-ns") else line for line in lines))
    return file


def expect_refusal(folder: Path, *words: str, arguments: list, **options) -> None:
    before = sorted(folder.iterdir())
    said = convert(*arguments, **options)
    expect(f"refused: {words[0]}", said.returncode == 1 and all(word in said.stderr for word in words) and said.stderr.count("\n") == 1, said.stderr.strip())
    expect("nothing is left", sorted(folder.iterdir()) == before)


def check_interruptions(folder: Path) -> None:
    """A recording of some minutes, stopped by a full disk and by a signal."""
    header, *rows = (folder / "rt.csv").read_text().splitlines()
    at = header.split(",").index("now_ns")
    with (folder / "long.csv").open("w") as file:
        file.write(header + "\n")
        for k in range(200_000):
            cells = rows[k % len(rows)].split(",")
            cells[at] = str(10**12 + k * 10**6)
            file.write(",".join(cells) + "\n")

    def fill_disk() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1 << 20, 1 << 20))
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    expect_refusal(folder, "long.mcap cannot be written: file too large", "--out FILE.mcap", arguments=[folder / "long.csv"], preexec_fn=fill_disk,
                   restore_signals=False)

    before = sorted(folder.iterdir())
    process = subprocess.Popen([TOOLCHAIN + "/mcap", str(folder / "long.csv")], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while not any(part.stat().st_size > 1000 for part in folder.glob("*.part")) and process.poll() is None and time.monotonic() < until:
        time.sleep(0.01)
    expect("it writes", process.poll() is None and sorted(folder.iterdir()) != before)
    process.terminate()
    process.communicate(timeout=30)
    expect("a stopped conversion leaves nothing", process.returncode != 0 and sorted(folder.iterdir()) == before, process.returncode)


def check_without_node(folder: Path) -> None:
    """Where node is missing and cannot be installed, the package is named. Everything else that the script calls is there."""
    tools = folder / "tools"
    tools.mkdir()
    for tool in ("bash", "env", "dirname", "awk", "sed", "mktemp", "id", "rm", "grep", "tail", "cat"):
        (tools / tool).symlink_to(shutil.which(tool))
    for tool, text in (("apt-get", 'echo "W: Could not resolve" >&2; exit 100'), ("dpkg-query", "exit 1"), ("sudo", "exit 1")):
        (tools / tool).write_text(f"#!/bin/sh\n{text}\n".replace("/bin/sh", shutil.which("sh")))
        (tools / tool).chmod(0o755)
    said = convert(folder / "rt.csv", env={"PATH": str(tools), "TMPDIR": str(folder)})
    expect("node's package is named", said.returncode == 1 and "missing: nodejs npm" in said.stderr and "Install them" in said.stderr, said.stderr.strip())


def main() -> None:
    with tempfile.TemporaryDirectory() as work:
        folder = Path(work)
        skip_if_missing(folder)
        record(folder)
        check_conversion(folder)
        check_buttons_and_lost_answers(folder)
        check_options(folder)
        check_refusals(folder)
        check_interruptions(folder)
        check_without_node(folder)


if __name__ == "__main__":
    main()
