"""A long command shows a progress bar at a terminal, erases it before its results, and shows none elsewhere.

progress.py WORK PROGRAM ARGUMENT...
"""

import re
import subprocess
import sys

from terminal import MAX_SECONDS, Terminal

ERASE_LINE = "\x1b[K"


def main() -> None:
    work, *command = sys.argv[1:]
    bar = re.escape(work) + r" \[#*-*\] +(\d+) %"

    shown = Terminal(*command)
    if (status := shown.status()) != 0:
        sys.exit(f"error: status {status}:\n{shown.output}")
    shares = [int(share) for share in re.findall(bar, shown.output)]
    if len(shares) < 3 or shares != sorted(shares) or shares[-1] < 80:
        sys.exit(f"error: the bar's shares are {shares}:\n{shown.output}")
    # Whatever a terminal still shows of the bar is what follows its last drawing.
    last = re.split(bar, shown.output)[-1]
    if "\r" + ERASE_LINE not in last:
        sys.exit(f"error: the bar is not erased:\n{shown.output!r}")

    dumb = Terminal(*command, kind="dumb")
    if dumb.status() != 0 or ERASE_LINE in dumb.output or re.search(bar, dumb.output):
        sys.exit(f"error: a bar at a terminal that has no control sequences:\n{dumb.output!r}")

    piped = subprocess.run(command, capture_output=True, text=True, timeout=MAX_SECONDS, check=True)
    if ERASE_LINE in piped.stderr or re.search(bar, piped.stderr):
        sys.exit(f"error: a bar in a pipe:\n{piped.stderr!r}")


main()
