"""Maps of the stability of scenes: see toolchain/study."""
import csv
import sys
import tempfile
from pathlib import Path

from haptic import study
from programs import HOST_SIM, RT_CORE


def row_of_map(*options, scene, rate_hz, stiffness_n_m):
    """Maps where a hand that is held in a scene comes to rest: trials of `rt-core stability --scene`, a row of the map a run."""
    with tempfile.TemporaryDirectory() as folder:
        # Status 3: a trial grows.
        study.output_of([RT_CORE, "stability", "--host-sim", HOST_SIM, "--out", folder, "--scene", scene, "--rates",
                         str(rate_hz), "--stiffnesses", str(stiffness_n_m), *options], statuses=(0, 3))
        with Path(folder, f"stability-{Path(scene).stem}.csv").open() as file:
            trials = list(csv.DictReader(file))
    return [{name: float(value) for name, value in trial.items() if name not in ("rate_hz", "stiffness_n_m")}
            for trial in trials]


if __name__ == "__main__":
    rows = study.main(row_of_map, scene=["curtain-hand"], rate_hz=[30, 60, 100, 200], stiffness_n_m=[50, 200, 600, 2000])
    if growing := sum(row["grows"] > 0 for row in rows):
        sys.exit(f"error: {growing} of {len(rows)} trials grow")
