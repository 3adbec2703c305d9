"""Hands for tests of whole sessions, from the scripts of scenes."""
import csv
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

PRESSED_S = 2.0  # of the loop's time: the hand is down


def script_of(host_sim: str, scene: str, seconds: float) -> list[dict[str, str]]:
    """How a scene's own hand moves, as rows of host-sim's recording."""
    with tempfile.TemporaryDirectory() as work:
        file = Path(work, "script.csv")
        subprocess.run([host_sim, "run", scene, "--duration", str(seconds), "--record", str(file)], check=True, capture_output=True)
        with file.open() as recording:
            return list(csv.DictReader(line for line in recording if not line.startswith("#")))


def write_track(hand: Path, track: Sequence[tuple[float, dict]]) -> None:
    """A hand for --hand of rt-core: at these times, s, the poses and buttons of rows of a recording of host-sim."""
    columns = ("x_m", "y_m", "z_m", "qw", "qx", "qy", "qz", "buttons")
    with hand.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time_s", *columns])
        writer.writerows([at, *(row[column] for column in columns)] for at, row in track)


def write_hand(host_sim: str, folder: Path, buttons: int = 0) -> Path:
    """Where the hand of gel-block presses deepest, and stays; these buttons are held while it presses."""
    script = script_of(host_sim, "gel-block", 1.5)
    above, below = script[0], script[-1]
    hand = folder / "hand.csv"
    write_track(hand, [(0, above), (1, above), (PRESSED_S, {**below, "buttons": buttons}), (20, below)])
    return hand


def expect(what: str, holds: bool, *details) -> None:
    if not holds:
        sys.exit("error: " + what + ": " + ", ".join(map(str, details)))
    print("ok:", what, *details)
