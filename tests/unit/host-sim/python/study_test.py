"""haptic.study: a table of all combinations, on this machine and on others, with failures and resumption, and runs of
programs.

The other machines are UTS namespaces with a name of their own, entered by a program that takes the place of ssh.
"""
import csv
import json
import os
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import haptic
from haptic import study

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
# What the runs are given, and when they run.
ECHO = """
import os
import time
from haptic import study

def echo(*arguments, word, number, apart):
    begin = time.monotonic()
    time.sleep(float(os.environ.get("PAUSE_S", "0.05")))
    return [{"arguments": " ".join(arguments), "type": type(number).__name__, "begin": begin, "end": time.monotonic(),
             "part": part} for part in (1, 2)]

if __name__ == "__main__":
    rows = study.main(echo, alone=lambda *_, word, number, apart: apart, word=["{} 'a' \\"b\\""], number=[1, 2.5],
                      apart=[False, True])
    print(len(rows), "rows")
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
        ended = subprocess.run([sys.executable, "-B", str(self.script), *arguments], cwd=self.folder, capture_output=True,
                               text=True, timeout=60, env={**os.environ, "HOME": str(self.folder), **environment})
        self.assertEqual(ended.returncode, status, ended.stderr)
        return ended

    def echo(self, *arguments, status=0, **environment):
        self.script.write_text(ECHO)
        return self.run_study(*arguments, status=status, **environment)

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
        refused = self.run_study("--run", '{"number": 0}', "--slot", "1", "--origin", "other", status=2)
        self.assertIn("another version", refused.stderr)
        self.assertEqual(refused.stdout, "")

    def test_without_parallel_it_says_what_to_install(self):
        self.assertIn("apt install parallel", self.run_study(status=1, PATH="/nowhere").stderr)

    def test_arguments_are_checked(self):
        self.assertIn("--resume needs --out", self.run_study("--resume", status=2).stderr)
        self.assertIn("at least 1", self.run_study("--jobs", "0", status=2).stderr)
        self.assertIn("study of 6 runs", self.run_study("--help").stdout)
        self.assertIn("--stiffness: invalid number value: 'soft'", self.run_study("--stiffness", "soft", status=2).stderr)
        self.assertIn("takes no arguments after --", self.run_study("--", "more", status=2).stderr)
        self.script.write_text("from haptic import study\nstudy.main(dict, jobs=[1])\n")
        self.assertIn("cannot have a parameter named jobs", self.run_study(status=1).stderr)

    def test_the_command_line_replaces_values(self):
        rows = self.table(self.run_study("--stiffness", "75", "12.5", "--steps", "10").stdout)
        self.assertEqual([(row["stiffness"], row["steps"]) for row in rows], [("75", "10"), ("12.5", "10")])

    def test_runs_are_given_what_was_written(self):
        ended = self.echo("--number", "3", "4.5", "--apart", "false", "--", "--set", "a=b c")
        rows = self.table(ended.stdout.replace("4 rows\n", ""))
        self.assertEqual({row["word"] for row in rows}, {"{} 'a' \"b\""})
        self.assertEqual({row["arguments"] for row in rows}, {"--set a=b c"})
        self.assertEqual([(row["number"], row["type"]) for row in rows[::2]], [("3", "int"), ("4.5", "float")])

    def test_runs_and_rows_may_be_larger_than_a_pipe(self):
        # 64 kB fit into one: here are 160 kB of runs and three times as much of rows.
        numbers = [str(number) for number in range(8)]
        ended = self.echo("--number", *numbers, "--apart", "false", "--", 20000 * "x")
        rows = self.table(ended.stdout.replace("16 rows\n", ""))
        self.assertEqual([row["number"] for row in rows[::2]], numbers)
        self.assertEqual({row["arguments"] for row in rows}, {20000 * "x"})

    def test_no_other_run_is_beside_one_that_must_be_alone(self):
        # So long that two runs overlap, although one may start late.
        ended = self.echo("--jobs", "4", PAUSE_S="1.5")
        # Two rows a run, which the script gets.
        self.assertTrue(ended.stdout.endswith("\n8 rows\n"), ended.stdout)
        rows = self.table(ended.stdout.replace("8 rows\n", ""))
        self.assertEqual([row["part"] for row in rows], 4 * ["1", "2"])
        times = {(row["number"], row["apart"]): (float(row["begin"]), float(row["end"])) for row in rows}
        for (_, apart), (begin, end) in times.items():
            beside = sum(other_begin < end and begin < other_end for other_begin, other_end in times.values()) - 1
            self.assertEqual(beside, 0 if apart == "True" else 1, times)

    def test_rows_made_with_other_arguments_are_refused(self):
        one = ("--out", "t.csv", "--number", "1", "--apart", "false")
        row = {"number": 0, "parameters": {"word": "{} 'a' \"b\"", "number": 1, "apart": False}, "rows": []}
        for arguments, status in (["one"], 0), (["two"], 1):
            (self.folder / "t.csv.rows").write_text(json.dumps({**row, "arguments": arguments}) + "\n")
            resumed = self.echo(*one, "--resume", "--", "one", status=status)
            self.assertEqual("is of another study" in resumed.stderr, status == 1)

    def test_programs_return_their_output_and_reports(self):
        run = [os.environ["HOST_SIM"], "run", "plane-slide", "--clock", "lockstep", "--duration", "0.2"]
        self.assertEqual(study.report_of(run)["steps"], haptic.Simulation("plane-slide").run(duration=0.2).size)
        self.assertEqual(study.output_of(["sh", "-c", "echo said; exit 3"], statuses=(0, 3)), "said\n")
        with self.assertRaisesRegex(RuntimeError, "sh -c 'exit 3' ended with status 3"):
            study.output_of(["sh", "-c", "exit 3"])
        # Status 1 is also that of a run in which a sphere escaped, which has a report.
        with self.assertRaisesRegex(RuntimeError, r'host-sim run plane-slid .* ended with status 1:\n.*unknown scene "plane-slid"'):
            study.report_of([*run[:2], "plane-slid", "--clock", "lockstep"], statuses=(0, 1))


if __name__ == "__main__":
    unittest.main()
