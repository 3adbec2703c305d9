#!/usr/bin/env python3
"""The negative control's verdicts fail where they must: verdicts_test.py VERDICTS

Reports as the emulated machine would write them, each time with one thing changed.
"""
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from pressing import expect

VERDICTS = sys.argv[1]
KERNELS = {"ordinary": "6.1.0-1-amd64 #1 SMP PREEMPT_DYNAMIC", "real-time": "6.1.0-1-rt-amd64 #1 SMP PREEMPT_RT"}


def report(kernel: str, slowest_us: float, missed: int, late: dict | None = None, faults: int = 0, missing: str = "") -> dict:
    latency = {"p50": 5.0, "p99": slowest_us, "p999": slowest_us, "max": slowest_us}
    setup = {"kernel": KERNELS[kernel], "preempt_rt": kernel == "real-time", "cpu": -1 if missing else 0}
    setup["missing"] = [{"what": missing}] if missing else []
    return {
        "overruns": missed,
        "page_faults": faults,
        "setup": setup,
        "measure": {"latency_us": {"wakeup": latency}, "break": late, "worst_ticks": [{"late_us": slowest_us}]},
    }


def doctor(kernel: str, rival: str = "") -> dict:
    return {
        "checks": [
            {"name": "kernel", "verdict": "good" if kernel == "real-time" else "bad", "found": KERNELS[kernel]},
            {"name": "rivals", "verdict": "bad" if rival else "good", "found": rival or "no other thread"},
        ]
    }


def late(cause: str, thread: str = "") -> dict:
    return {"cause": cause, "thread": thread}


def beside_peers(slowest_us: float, peers_us: float) -> dict:
    """The loop's report, and that of tools which took turns with it."""
    whole = report("real-time", slowest_us, 0)
    wakeup = {"p50": peers_us, "p99": peers_us, "p999": peers_us, "max": peers_us}
    ratio = {key: slowest_us / peers_us for key in wakeup}
    whole["measure"] |= {name: {"wakeup_us": wakeup, "ratio": ratio} for name in ("cyclictest", "timerlat")}
    whole["measure"]["osnoise"] = {"noise": {"available_percent": 99.0}}
    return whole


def without(peer: str) -> dict:
    """As if that tool were not installed."""
    whole = beside_peers(6, 5)
    whole["measure"][peer] = {"missing": "no program of this name"}
    return whole


SOUND = {
    "ordinary/load": report("ordinary", 3700, 141),
    "ordinary/doctor": doctor("ordinary"),
    "real-time/load": report("real-time", 7, 0),
    "real-time/doctor": doctor("real-time"),
    "real-time/peers": beside_peers(6, 5),
    "real-time/none": report("real-time", 11, 0),
    "real-time/page-fault": report("real-time", 11, 2, late("page_fault"), faults=2048),
    "real-time/priority-inversion": report("real-time", 11, 2, late("priority_inversion", "holder-437")),
    "real-time/unpinned": report("real-time", 11, 0, missing="not pinned to processor 1: Invalid argument"),
    "real-time/interrupt-priority": report("real-time", 357, 0, late("higher_priority", "irq/31-virtio3--103")),
    "real-time/doctor-interrupt": doctor("real-time", "irq/31-virtio3-req.0 (103) has priority 90"),
}


def judged(**changed: dict) -> tuple[int, list[str]]:
    """Exit status, and the claims that fail, with these reports instead; "__" in a name is its folder's end."""
    with tempfile.TemporaryDirectory() as folder:
        for name, content in {**SOUND, **{key.replace("__", "/").replace("_", "-"): one for key, one in changed.items()}}.items():
            file = Path(folder, name + ".json")
            file.parent.mkdir(exist_ok=True)
            file.write_text(json.dumps(content))
        done = subprocess.run([sys.executable, "-B", VERDICTS, folder], capture_output=True, text=True)
    expect("verdicts says no error", not done.stderr, done.stderr)
    return done.returncode, [line for line in done.stdout.splitlines() if line.startswith("FAIL: ")]


def fails(wanted: list[str], **changed: dict) -> None:
    status, failed = judged(**changed)
    for words in wanted:
        expect(f"with other {', '.join(changed)} a claim fails: {words}", any(words in line for line in failed), failed)
    expect("... and no other one", len(failed) == len(wanted) and status == 1, status, failed)


status, failed = judged()
expect("every claim holds for sound reports", status == 0 and not failed, failed)

# An ordinary kernel that is as good: nothing is shown by the other.
fails(["no tick is missed", "each wake-up", "slowest wake-up"], ordinary__load=report("ordinary", 8, 0))
# Twice the same kernel.
fails(["same version", "call the kernel", "no tick is missed", "each wake-up", "slowest wake-up"],
      ordinary__load=report("real-time", 7, 0) | {"setup": SOUND["real-time/load"]["setup"] | {"kernel": "6.1.0-2-rt-amd64"}},
      ordinary__doctor=doctor("real-time"))
# A PREEMPT_RT kernel that is as bad.
fails(["no tick is missed", "each wake-up", "slowest wake-up"], real_time__load=report("real-time", 3000, 90))
# Other tools that find something else, or that do not run.
fails(["p99.9 of its wake-up and of theirs"], real_time__peers=beside_peers(30, 5))
fails(["p99.9 of its wake-up and of theirs"], real_time__peers=beside_peers(5, 30))
fails(["in turns with the loop"], real_time__peers=without("osnoise"))
fails(["in turns with the loop", "p99.9 of its wake-up and of theirs"], real_time__peers=without("timerlat"))
# Defects that nobody finds, that take another name, and one where there is none.
fails(["no tick is late", "page faults are counted", "the trace names page_fault"], real_time__page_fault=report("real-time", 11, 0))
fails(["the trace names priority_inversion"], real_time__priority_inversion=report("real-time", 11, 2, late("device")))
fails(["the loop is pinned"], real_time__unpinned=report("real-time", 11, 0))
fails(["the doctor names"], real_time__doctor_interrupt=doctor("real-time"))
fails(["no tick is late", "the trace names higher_priority"],
      real_time__none=report("real-time", 400, 0, late("higher_priority", "irq/31-virtio3--103")))
