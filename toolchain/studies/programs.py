"""The programs that studies run: of the same build as the package haptic, or installed beside it."""
from pathlib import Path

import haptic


def _program(name):
    built = Path(haptic.__file__).resolve().parents[3] / name / name
    return str(built) if built.exists() else name


FIRMWARE_HOST, HOST_SIM, RT_CORE = map(_program, ("firmware-host", "host-sim", "rt-core"))
