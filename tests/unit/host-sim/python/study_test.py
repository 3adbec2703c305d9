"""haptic.study: a table of all combinations, on this machine and on others, with failures and resumption.

The other machines are UTS namespaces with a name of their own, entered by a program that takes the place of ssh.
"""
import csv
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

SCRIPT = """
import sys
import haptic
from haptic import study

def slide(stiffness, steps):
    print("this is no row")
    if {broken}:
        raise RuntimeError("broken on purpose")
    sim = haptic.Simulation("plane-slide", {{"coupling.stiffness": stiffness}})
    run = sim.run(steps)
    return {{"peak_n": abs(run.hand_force).max(), "state": f"{{sim.state_hash:016x}}"}}

if __name__ == "__main__":
    study.main(slide, stiffness=[{stiffness}], steps=[{steps}])
"""
SSH = """#!/bin/sh
# ssh HOST COMMAND: on a machine that is only a name. As sshd does, it sets SHELL, which GNU parallel runs the command with.
export SHELL=/bin/sh
while [ "${1#-}" != "$1" ]; do
    [ "$1" = -l ] && shift
    shift
done
host=$1
shift
[ "$1" != -- ] || shift
exec unshare --uts sh -c 'hostname "$1" && shift && exec sh -c "$*"' sh "$host" "$@"
"""


class Studies(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.script = self.folder / "slide.py"
        self.write()

    def write(self, stiffness="50, 100, 200", steps="100, 150", broken="False"):
        self.script.write_text(SCRIPT.format(stiffness=stiffness, steps=steps, broken=broken))

    def run_study(self, *arguments, status=0, **environment):
        ended = subprocess.run([sys.executable, "-B", str(self.script), *arguments], cwd=self.folder, capture_output=True, text=True,
                               env={**os.environ, "HOME": str(self.folder), **environment})
        self.assertEqual(ended.returncode, status, ended.stderr)
        return ended

    def table(self, text):
        rows = list(csv.DictReader(text.splitlines()))
        for row in rows:
            self.assertGreater(float(row.pop("seconds")), 0)
        return rows

    def test_every_combination_has_a_row_in_order(self):
        rows = self.table(self.run_study().stdout)
        self.assertEqual([(row["stiffness"], row["steps"]) for row in rows],
                         [(k, n) for k in ("50", "100", "200") for n in ("100", "150")])
        peaks = [float(row["peak_n"]) for row in rows[1::2]]
        self.assertEqual(peaks, sorted(peaks))

    def test_the_table_does_not_depend_on_the_number_of_processors(self):
        self.assertEqual(self.table(self.run_study("--jobs", "1").stdout), self.table(self.run_study("--jobs", "4").stdout))

    def test_failures_are_named_and_resumed(self):
        self.write(broken="stiffness == 100 and not sys.argv[0].startswith('-')")
        failed = self.run_study("--out", "t.csv", status=1)
        self.assertIn("stiffness=100, steps=150: RuntimeError: broken on purpose", failed.stderr)
        self.assertIn("2 of 6 runs have no result", failed.stderr)
        self.assertEqual(len(self.table((self.folder / "t.csv").read_text())), 4)
        kept = (self.folder / "t.csv.rows").read_text()
        # The row that was being written when the power went.
        (self.folder / "t.csv.rows").write_text(kept + kept[:20])
        self.write()
        resumed = self.run_study("--out", "t.csv", "--resume")
        self.assertNotIn("error", resumed.stderr)
        self.assertEqual(self.table((self.folder / "t.csv").read_text()), self.table(self.run_study().stdout))
        self.assertFalse((self.folder / "t.csv.rows").exists())

    def test_rows_of_another_study_are_refused(self):
        self.write(broken="stiffness == 100")
        self.run_study("--out", "t.csv", status=1)
        self.write(stiffness="60, 100, 200")
        self.assertIn("t.csv.rows is of another study", self.run_study("--out", "t.csv", "--resume", status=1).stderr)

    def test_machines_share_the_runs(self):
        if subprocess.run(["unshare", "--uts", "true"], capture_output=True).returncode != 0:
            self.skipTest("needs the right to make a namespace")
        ssh = self.folder / "ssh"
        ssh.write_text(SSH)
        ssh.chmod(0o755)
        alone = self.table(self.run_study().stdout)
        rows = self.table(self.run_study("--machines", "lab1,lab2", "--jobs", "1", PARALLEL_SSH=str(ssh)).stdout)
        self.assertEqual({row.pop("machine") for row in rows}, {"lab1", "lab2"})
        for row in alone:
            row.pop("machine")
        self.assertEqual(rows, alone)

    def test_a_machine_with_another_script_is_refused(self):
        refused = self.run_study("--run", "0", "--slot", "1", "--origin", "other", status=2)
        self.assertIn("another version", refused.stderr)
        self.assertEqual(refused.stdout, "")

    def test_without_parallel_it_says_what_to_install(self):
        self.assertIn("apt install parallel", self.run_study(status=1, PATH="/nowhere").stderr)

    def test_arguments_are_checked(self):
        self.assertIn("--resume needs --out", self.run_study("--resume", status=2).stderr)
        self.assertIn("at least 1", self.run_study("--jobs", "0", status=2).stderr)
        self.assertIn("study of 6 runs", self.run_study("--help").stdout)


if __name__ == "__main__":
    unittest.main()
