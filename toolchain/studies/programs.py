"""The programs that studies run: of the same build as the package haptic, or installed beside it."""
import itertools
import sys
from pathlib import Path

import haptic


def _program(name):
    built = Path(haptic.__file__).resolve().parents[3] / name / name
    return str(built) if built.exists() else name


def refuse_machines(reason):
    """Ends a study whose runs cannot be on other machines, if its command line names some."""
    own = itertools.takewhile(lambda argument: argument != "--", sys.argv[1:])
    if any(argument.split("=")[0] == "--machines" for argument in own):
        sys.exit(f"error: this study has no --machines: {reason}")


FIRMWARE_HOST, HOST_SIM, RT_CORE = map(_program, ("firmware-host", "host-sim", "rt-core"))
