"""A program at a pseudo terminal."""

import os
import pty
import re
import select
import sys
import time

MAX_SECONDS = 60


class Terminal:
    """A program at a pseudo terminal."""

    def __init__(self, *command: str, kind: str = "xterm"):
        self.output = ""
        self.pid, self.descriptor = pty.fork()
        if self.pid == 0:
            os.environ["TERM"] = kind
            os.execv(command[0], command)

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
