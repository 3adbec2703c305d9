"""host-sim without arguments, at a terminal: offers the live view, runs it after Enter, and does not after "n".

offer.py HOST_SIM
"""

import sys
import urllib.request

from terminal import MAX_SECONDS, Terminal

def main() -> None:
    declined = Terminal(sys.argv[1])
    declined.wait_for(r"\[Y/n\]")
    declined.type("n\n")
    declined.wait_for("A command .* is required")
    if (status := declined.status()) != 64:
        sys.exit(f"error: status {status} after 'n', expected 64:\n{declined.output}")

    accepted = Terminal(sys.argv[1])
    accepted.wait_for(r"\[Y/n\]")
    accepted.type("\n")
    address = accepted.wait_for(r"the live view is at (http://\S+/)").group(1)
    with urllib.request.urlopen(address, timeout=MAX_SECONDS) as page:
        if b"<html" not in page.read():
            sys.exit(f"error: {address} is no page")
    accepted.type("\x03")  # Ctrl-C
    accepted.wait_for("fish-grab: ")
    if (status := accepted.status()) != 0:
        sys.exit(f"error: status {status} after Ctrl-C, expected 0:\n{accepted.output}")


main()
