"""Peak forces of scenes, and the reach of a device: see toolchain/study."""
import re
import tempfile
from pathlib import Path

import haptic
from haptic import study
from programs import FIRMWARE_HOST, HOST_SIM


def peaks(*options, scene, geometry):
    """Peak force and torque at the hand of each scene's script, and what a device reaches of its poses and wrenches."""
    with tempfile.TemporaryDirectory() as folder:
        record = Path(folder, "record.csv")
        report = study.report_of([HOST_SIM, "run", scene, "--clock", "lockstep", "--record", record, *options])
        reach = study.output_of([FIRMWARE_HOST, "reach", record, "--geometry", geometry])

    def reached(line):
        return float(re.search(rf"^{line} +(\S+)", reach, re.MULTILINE)[1])

    return {"force_n": round(report["force_N"]["max"], 3), "mean_n": round(report["force_N"]["mean_in_contact"], 3),
            "torque_mnm": reached("peak torque"), "excursion_mm": reached("largest excursion"),
            "rotation_deg": reached("largest rotation"), "share_percent": reached("peak share of the reach"),
            "contact_percent": round(100 * report["contact"]["steps_in_contact"] / report["steps"], 1),
            "not_wrench_closed": int(reached("poses not wrench-closed")),
            "out_of_reach": int(reached("wrenches out of reach"))}


if __name__ == "__main__":
    study.main(peaks, scene=sorted(haptic.scenes()), geometry=["SpidarG6X3R"])
