"""Hands for tests of whole sessions, from the scripts of scenes."""
import csv
import subprocess
import sys
import tempfile
from pathlib import Path

PRESSED_S = 2.0  # of the loop's time: the hand is down


def script_of(host_sim: str, scene: str, seconds: float) -> list[dict[str, str]]:
    """How a scene's own hand moves, as rows of host-sim's recording."""
    with tempfile.TemporaryDirectory() as work:
        file = Path(work, "script.csv")
        subprocess.run([host_sim, "run", scene, "--duration", str(seconds), "--record", str(file)], check=True, capture_output=True)
        with file.open() as recording:
            return list(csv.DictReader(line for line in recording if not line.startswith("#")))


def write_hand(host_sim: str, folder: Path) -> Path:
    """Where the hand of gel-block presses deepest, and stays."""
    rows = script_of(host_sim, "gel-block", 1.5)
    above, below = rows[0], rows[-1]
    hand = folder / "hand.csv"
    hand.write_text("time_s,x_m,y_m,z_m\n" + "".join(
        f"{at},{row['x_m']},{row['y_m']},{row['z_m']}\n" for at, row in ((0, above), (1, above), (PRESSED_S, below), (20, below))))
    return hand


def expect(what: str, holds: bool, *details) -> None:
    if not holds:
        sys.exit("error: " + what + ": " + ", ".join(map(str, details)))
    print("ok:", what, *details)
