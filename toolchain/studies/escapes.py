"""The soak for escapes: see toolchain/study."""
import shlex
import sys
from pathlib import Path

import haptic
from haptic import study
from programs import HOST_SIM

KEPT_APART = ["sheets", "solids", "ground"]


def soak(*options, scene, hand, settings, rate_hz, duration_s):
    """Runs each scene for long, its hand scripted or hostile, its settings its own or changing at random, and counts
    spheres that passed through a surface, and the steps in which surfaces crossed themselves, one another or the ground.
    A run that fails is made again for its recording."""
    command = [HOST_SIM, "run", scene, "--clock", "lockstep", "--hand", hand, "--duration", str(duration_s), "--verify"]
    if settings == "random":
        # Other settings beside each hostile hand.
        settings = ":".join(["random", *hand.split(":")[1:]])
    if settings != "scene":
        command += ["--settings", settings]
    if rate_hz != "own":
        command += ["--set", f"solver.step={1 / float(rate_hz)}"]
    command += options
    contact = (report := study.report_of(command, statuses=(0, 1)))["contact"]
    surfaces = report["surface_crossings"]
    if report["sim_s"] < duration_s - 0.1:
        raise RuntimeError(f"the scene diverged after {report['sim_s']} s: {shlex.join(command)}")
    if contact["escapes"] or any(surfaces[kind]["steps"] for kind in KEPT_APART):
        print(f"escaped: {shlex.join(command)}", flush=True)
        # Beside the program of a build folder; in the working folder if it is installed.
        name = f"escaped-{Path(scene).stem}-{hand}-{settings}-{rate_hz}-{duration_s}.csv".replace(":", "-")
        record = Path(HOST_SIM).parent.resolve() / name
        try:
            study.report_of([*command, "--record", record], statuses=(0, 1))
            print(f"to look at it: {shlex.join([HOST_SIM, 'play', str(record)])}")
        except RuntimeError as error:
            print(f"not recorded: {error}")
    return {"steps": report["steps"], "in_contact": contact["steps_in_contact"], "escapes": contact["escapes"],
            "squeezed": contact["squeezed_steps"], "sheets": surfaces["sheets"]["steps"],
            "solids": surfaces["solids"]["steps"], "others": surfaces["others"]["steps"],
            "ground": surfaces["ground"]["steps"],
            "ground_depth_mm": round(1e3 * surfaces["ground"]["max_depth_m"], 3)}


if __name__ == "__main__":
    rows = study.main(soak, scene=sorted(haptic.scenes()), hand=["script", "hostile:1", "hostile:2"],
                      settings=["scene", "random"], rate_hz=["own"], duration_s=[600])
    if escaped := sum(row["escapes"] > 0 or any(row[kind] > 0 for kind in KEPT_APART) for row in rows):
        sys.exit(f"error: a sphere, a sheet or a solid passed through a surface, or something into the ground, in "
                 f"{escaped} of {len(rows)} runs")
