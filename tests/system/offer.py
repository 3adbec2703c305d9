"""host-sim without arguments, at a terminal: offers the live view, runs it after Enter, and does not after "n".

offer.py HOST_SIM
"""

import os
import pty
import re
import select
import sys
import time
import urllib.request

MAX_SECONDS = 60


class Terminal:
    """A program at a pseudo terminal."""

    def __init__(self, program: str):
        self.output = ""
        self.pid, self.descriptor = pty.fork()
        if self.pid == 0:
            os.execv(program, [program])

    def wait_for(self, pattern: str) -> re.Match:
        until = time.monotonic() + MAX_SECONDS
        while not (found := re.search(pattern, self.output)):
            if time.monotonic() > until or not self.read(1.0):
                sys.exit(f"error: no '{pattern}' at the terminal, but:\n{self.output}")
        return found

    def read(self, seconds: float) -> bool:
        """False once the program has closed the terminal."""
        if select.select([self.descriptor], [], [], seconds)[0]:
            try:
                self.output += os.read(self.descriptor, 4096).decode(errors="replace")
            except OSError:
                return False
        return True

    def type(self, text: str) -> None:
        os.write(self.descriptor, text.encode())

    def status(self) -> int:
        until = time.monotonic() + MAX_SECONDS
        while self.read(0.1) and time.monotonic() < until:
            pass
        return os.waitstatus_to_exitcode(os.waitpid(self.pid, 0)[1])


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
