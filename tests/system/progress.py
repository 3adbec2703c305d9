"""A run of limited duration shows a progress bar at a terminal, erases it before its results, and shows none elsewhere.

progress.py RT_CORE
"""

import re
import subprocess
import sys

from terminal import MAX_SECONDS, Terminal

ERASE_LINE = "\x1b[K"
BAR = r"running \[#*-*\] +\d+ %"


def main() -> None:
    command = [sys.argv[1], "run", "--duration", "2", "--session", "progress-test"]

    shown = Terminal(*command)
    if (status := shown.status()) != 0:
        sys.exit(f"error: status {status}:\n{shown.output}")
    shares = [int(share) for share in re.findall(r"running \[#*-*\] +(\d+) %", shown.output)]
    if len(shares) < 3 or shares != sorted(shares) or shares[-1] < 80:
        sys.exit(f"error: the bar's shares are {shares}:\n{shown.output}")
    # Whatever a terminal still shows of the bar is what follows its last drawing.
    last = re.split(BAR, shown.output)[-1]
    if ERASE_LINE not in last.split("rt-core")[0]:
        sys.exit(f"error: the bar is not erased:\n{shown.output!r}")

    dumb = Terminal(*command, kind="dumb")
    if dumb.status() != 0 or ERASE_LINE in dumb.output or re.search(BAR, dumb.output):
        sys.exit(f"error: a bar at a terminal that has no control sequences:\n{dumb.output!r}")

    piped = subprocess.run(command, capture_output=True, text=True, timeout=MAX_SECONDS, check=True)
    if ERASE_LINE in piped.stderr or re.search(BAR, piped.stderr):
        sys.exit(f"error: a bar in a pipe:\n{piped.stderr!r}")


main()
