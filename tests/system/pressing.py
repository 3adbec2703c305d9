"""A hand that presses the block of gel, and stays, for tests of whole sessions."""
import csv
import subprocess
import sys
from pathlib import Path

PRESSED_S = 2.0  # of the loop's time: the hand is down


def write_hand(host_sim: str, folder: Path) -> Path:
    """Where the scene's own hand presses deepest, and stays."""
    file = folder / "script.csv"
    subprocess.run([host_sim, "run", "gel-block", "--duration", "1.5", "--record", str(file)], check=True, capture_output=True)
    with file.open() as recording:
        rows = list(csv.DictReader(line for line in recording if not line.startswith("#")))
    above, below = rows[0], rows[-1]
    hand = folder / "hand.csv"
    hand.write_text("time_s,x_m,y_m,z_m\n" + "".join(
        f"{at},{row['x_m']},{row['y_m']},{row['z_m']}\n" for at, row in ((0, above), (1, above), (PRESSED_S, below), (20, below))))
    return hand


def expect(what: str, holds: bool, *details) -> None:
    if not holds:
        sys.exit("error: " + what + ": " + ", ".join(map(str, details)))
    print("ok:", what, *details)
