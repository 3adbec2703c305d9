"""What a network does to the force, as a table, and with --draw TABLE.csv PICTURE.png a map of it: see toolchain/study.

A run is two sessions in real time, one on one machine and one on two that a cable joins, which delays, jitters and
loses packets (delay_ms "none": both on one machine, so what differs is what differs from session to session). The grip
of the emulated device has mass and is held by a compliant hand, so the loop through the network is closed. Columns:

  error         rms of the difference between the two forces while the tool touches, as a share of the rms of the first
  held_n        N, mean force in the last second, in which the hand rests; alone_n: of the session on one machine
  vibration_n   N, rms of the part of it that is faster than 8 Hz
  energy_min_j  J, the least that rt-core's passivity observer saw: negative was given to the hand, but not taken before
  passive       smallest part of the wrench that the passivity controller left, 0..1
  age_ms        age of the device state that a rendered frame answers, its median: a round trip and a step; age_p99_ms:
                99th percentile
  arrived       share of the simulation's frames that arrived: a frame of many contacts is many packets
  stale_ticks   ticks of the loop without a fresh frame, whose force fades
  escapes       steps in which a surface passed through a sphere, as host-sim --verify counts them
"""
import csv
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from haptic import study
from programs import HOST_SIM, RT_CORE, refuse_machines

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tests/system"))
from pressing import script_of, write_track  # noqa: E402
from two_machines import Session, machines, possible, recorded  # noqa: E402

EMULATED_CABLE = Path(HOST_SIM).resolve().parents[1] / "tests/system/emulated_cable"
APPROACH_S = 1.0  # from the device's centre to where the script begins
WAIT_S = 2.0  # there, while the simulation starts
TOUCH_N = 0.05
TICK_S = 1e-3
FAST_HZ = 8.0
RUNNING = 3  # HAPTIC_RUNNING


@dataclass(frozen=True)
class Moment:
    """Until when a hand follows its scene's script, and for how long it then rests."""
    script_s: float  # 0: the scene moves by itself, while the hand rests at the centre
    rest_s: float


MOMENTS = {
    "cloth-drop": Moment(0.0, 4.0),  # until the cloth lies on the sphere
    "fish-grab": Moment(2.3, 2.0),  # until the fish is carried
    "gel-block": Moment(1.5, 2.0),  # until the gel is pressed
}


def session_of(scene: str, work: Path) -> Session:
    moment = MOMENTS[scene]
    rest = {"x_m": 0, "y_m": 0, "z_m": 0, "qw": 1, "qx": 0, "qy": 0, "qz": 0, "buttons": 0}
    script = script_of(HOST_SIM, scene, moment.script_s) if moment.script_s > 0.0 else [{**rest, "time_s": 0}]
    begin_s = APPROACH_S + WAIT_S
    write_track(work / "hand.csv", [(0.0, rest), (APPROACH_S, {**script[0], "buttons": 0})] +
                [(begin_s + float(row["time_s"]), row) for row in script])
    return Session(RT_CORE, HOST_SIM, scene, work / "hand.csv", begin_s + moment.script_s + moment.rest_s,
                   ["--set", "emulated.mechanics=impedance", "--set", "safety.prove=never"], loop_first_s=2.0)


class Felt:
    """What a session's hand felt."""

    def __init__(self, session: Session, folder: Path, linked: bool):
        folder.mkdir()
        processes = session.run(folder, linked)
        rows = np.array(recorded(folder / "rt.csv", "time_s", "fx_n", "fy_n", "fz_n", "passivity_scale",
                                 "safety_state"))
        rows = rows[rows[:, 5] == RUNNING]  # without the fade at the end
        self.force = np.zeros((round(rows[-1, 0] / TICK_S) + 1, 3))  # N, tick by tick of the loop's time
        self.force[np.round(rows[:, 0] / TICK_S).astype(int)] = rows[:, 1:4]
        self.passive = float(rows[:, 4].min())
        self.report = json.loads((folder / "rt.json").read_text())
        frames = np.array(recorded(folder / "rt.frames.csv", "now_ns", "state_time_ns", "particle"))
        answering = frames[(frames[:, 2] == 0) & (frames[:, 1] > 0)]
        self.ages_ms = 1e-6 * (answering[:, 0] - answering[:, 1])
        sent = re.search(r"(\d+) frames sent", processes.log("host-sim"))
        came = re.search(r"frames: (\d+) received", processes.log("relay")) if linked else None
        self.arrived = int(came[1]) / int(sent[1]) if sent and came else 1.0
        self.escapes = int(re.search(r"escapes +(\d+)", processes.log("host-sim"))[1])

    def from_first_touch(self) -> np.ndarray:
        touched = np.flatnonzero(np.linalg.norm(self.force, axis=1) > TOUCH_N)
        return self.force[touched[0]:] if touched.size else self.force[:0]

    def held(self) -> float:
        return float(np.linalg.norm(self.last_second().mean(axis=0)))

    def last_second(self) -> np.ndarray:
        return self.force[-round(1.0 / TICK_S):]

    def vibration(self) -> float:
        force = self.last_second()
        spectrum = np.fft.rfft(force, axis=0)
        spectrum[np.fft.rfftfreq(len(force), TICK_S) < FAST_HZ] = 0.0
        return float(np.sqrt(np.mean(np.sum(np.fft.irfft(spectrum, len(force), axis=0) ** 2, axis=1))))


def error(felt: Felt, alone: Felt, scripted: bool) -> float:
    """Over the loop's time where the hand follows a script, else since the first touch."""
    one, other = (alone.force, felt.force) if scripted else (alone.from_first_touch(), felt.from_first_touch())
    size = min(len(one), len(other))
    if not one[:size].any():
        return 1.0
    return float(np.sqrt(np.sum((other[:size] - one[:size]) ** 2) / np.sum(one[:size] ** 2)))


def feel(scene, delay_ms, jitter_ms, loss_percent):
    """Compares what the hand feels over a network with what it feels on one machine, in real time."""
    with tempfile.TemporaryDirectory() as folder:
        session = session_of(scene, Path(folder))
        alone = Felt(session, Path(folder, "alone"), linked=False)
        if delay_ms == "none":
            felt = Felt(session, Path(folder, "again"), linked=False)
        else:
            with machines([str(EMULATED_CABLE), "--delay", str(delay_ms), "--jitter", str(jitter_ms),
                           "--loss", str(loss_percent)]):
                felt = Felt(session, Path(folder, "linked"), linked=True)
    age = np.percentile(felt.ages_ms, [50, 99])
    return {"error": round(error(felt, alone, MOMENTS[scene].script_s > 0.0), 4), "held_n": round(felt.held(), 4),
            "alone_n": round(alone.held(), 4), "vibration_n": round(felt.vibration(), 4),
            "energy_min_j": felt.report["passivity"]["energy_min_j"], "passive": round(felt.passive, 3),
            "age_ms": round(age[0], 2), "age_p99_ms": round(age[1], 2), "arrived": round(felt.arrived, 4),
            "stale_ticks": felt.report["frames"]["stale_ticks"], "escapes": felt.escapes}


MAP = """
set terminal pngcairo size 1000,{height} font 'sans,11' background '#fbfaf7'
set output '{file}'
set multiplot layout {rows},2
set datafile separator comma
set palette defined (0 '#e9f1f5', 0.1 '#9cc3da', 0.3 '#e8b04a', 1 '#b3401f')
set cbrange [0:1]; unset colorbox; unset key; set border 3; set tics nomirror out
set xlabel 'delay in each direction, ms'; set ylabel 'loss, % of packets'
{plots}
unset multiplot
"""
PANEL = """
${name} << EOD
{cells}
EOD
set title '{title}'
set xrange [-0.5:{columns}-0.5]; set yrange [-0.5:{lines}-0.5]
set xtics ({delays}); set ytics ({losses})
plot ${name} using 1:2:(0.5):(0.5):(column(3) > 1 ? 1 : column(3)) with boxxyerror \\
     fillstyle solid 1 noborder linecolor palette, \\
     ${name} using 1:2:4 with labels
"""


NUMBERS = ("delay_ms", "jitter_ms", "loss_percent", "error", "held_n", "alone_n")


def table(file: str) -> list[dict]:
    """The rows of a table of this study that the map shows: those without jitter. delay_ms "none" is NaN."""
    try:
        with open(file, newline="") as lines:
            rows = [{"scene": row["scene"],
                     **{name: math.nan if row[name] == "none" else float(row[name]) for name in NUMBERS}}
                    for row in csv.DictReader(lines)]
    except OSError as problem:
        sys.exit(f"error: {file}: {problem.strerror}")
    except (KeyError, TypeError, ValueError) as problem:
        sys.exit(f"error: {file} is no table of this study: {type(problem).__name__}: {problem}")
    rows = [row for row in rows if row["jitter_ms"] == 0.0]
    if all(math.isnan(row["delay_ms"]) for row in rows):
        sys.exit(f"error: {file} has no row with a network without jitter: there is nothing to draw")
    return rows


def held(row: dict) -> float:
    """Share of the force that is held without a network; NaN where that is none."""
    return row["held_n"] / row["alone_n"] if row["alone_n"] > 0.0 else math.nan


def draw(rows: list[dict], file: str) -> None:
    """A panel for each scene of the error of the force, and one of the force that is held."""
    linked = [row for row in rows if not math.isnan(row["delay_ms"])]
    delays, losses = (sorted({row[name] for row in linked}) for name in ("delay_ms", "loss_percent"))
    scenes = list(dict.fromkeys(row["scene"] for row in linked))
    plots = ""
    for k, scene in enumerate(scenes):
        own = [row["error"] for row in rows if row["scene"] == scene and math.isnan(row["delay_ms"])]
        among = f" ({100 * np.median(own):.0f} without a network)" if own else ""
        for what, title, value in (
                ("error", f"{scene}: error of the force, %{among}", lambda row: (row["error"], row["error"])),
                ("held", f"{scene}: force held at the end, %", lambda row: (abs(1 - held(row)), held(row)))):
            cells = "\n".join(cell(delays.index(row["delay_ms"]), losses.index(row["loss_percent"]), *value(row))
                              for row in linked if row["scene"] == scene)
            plots += PANEL.format(name=f"{what}{k}", cells=cells, title=title, columns=len(delays), lines=len(losses),
                                  delays=", ".join(f"'{value:g}' {i}" for i, value in enumerate(delays)),
                                  losses=", ".join(f"'{value:g}' {i}" for i, value in enumerate(losses)))
    name = file.replace("'", "''")
    drawn = subprocess.run(["gnuplot"], input=MAP.format(file=name, rows=len(scenes), height=330 * len(scenes),
                                                         plots=plots), text=True, check=False)
    if drawn.returncode != 0:
        sys.exit(f"error: gnuplot could not draw {file}")


def cell(column: int, line: int, colour: float, share: float) -> str:
    """Place, colour and text of a cell."""
    return f"{column},{line},{colour},{'-' if math.isnan(share) else f'{100 * share:.0f}'}"


def draw_and_end(arguments: list[str]) -> None:
    """What --draw does: no run is made."""
    if len(arguments) != 2:
        sys.exit("error: --draw needs a table of this study and the picture to make: --draw TABLE.csv PICTURE.png")
    if not shutil.which("gnuplot"):
        sys.exit("error: gnuplot is not installed: apt install gnuplot-nox")
    draw(table(arguments[0]), arguments[1])
    sys.exit()


if __name__ == "__main__":
    if sys.argv[1:2] == ["--draw"]:
        draw_and_end(sys.argv[2:])
    refuse_machines("its runs are in network namespaces of this machine")
    if not possible():
        sys.exit("error: network namespaces cannot be made here: run this as root, where `ip netns add` is allowed")
    if not os.access(EMULATED_CABLE, os.X_OK):
        sys.exit(f"error: {EMULATED_CABLE} is not built; toolchain/study network builds it")
    study.main(feel, alone=lambda *_, **__: True, scene=["cloth-drop", "fish-grab"],
               delay_ms=["none", 0, 1, 2, 5, 10, 20], jitter_ms=[0], loss_percent=[0, 1, 5, 20])
