"""The studies of toolchain/study: what their tables hold is what the programs say that they run.

studies_test.py RT-CORE HOST-SIM STUDIES-FOLDER, with the package haptic of the same build in PYTHONPATH.
"""
import csv
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

from two_machines import possible

RT_CORE, HOST_SIM, STUDIES = (Path(argument) for argument in sys.argv[1:4])
EMULATED_CABLE = HOST_SIM.parents[1] / "tests/system/emulated_cable"
# A host-sim in whose runs two spheres escape.
ESCAPING = """#!/bin/sh
while [ $# != 0 ]; do
    case $1 in --report) report=$2 ;; --record) echo time_s >"$2" ;; esac
    shift
done
sim_s=${SIM_S:-5}
cat >"$report" <<END
{"steps": 100, "sim_s": $sim_s, "contact": {"steps_in_contact": 7, "escapes": 2, "squeezed_steps": 0},
 "surface_crossings": {"sheets": {"steps": 3}, "solids": {"steps": 0}, "others": {"steps": 0},
                       "ground": {"steps": 5, "max_depth_m": 0.0012}}}
END
exit 1
"""


class Studies(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def table(self, script, *arguments, status=0):
        """The rows of the table, and what the study said beside it."""
        table = self.folder / "table.csv"
        ended = subprocess.run([sys.executable, "-B", script, "--out", table, *arguments], cwd=self.folder,
                               capture_output=True, text=True)
        self.assertEqual(ended.returncode, status, ended.stderr)
        with table.open() as file:
            return list(csv.DictReader(file)), ended.stderr

    def test_escapes_are_counted_for_every_scene_hand_and_rate(self):
        rows, said = self.table(STUDIES / "escapes.py", "--scene", "plane-slide", "rod-gap", "--hand", "script",
                                "hostile:3", "--settings", "scene", "--rate-hz", "own", "25", "--duration-s", "1")
        self.assertEqual([(row["scene"], row["hand"], row["rate_hz"], row["steps"], row["escapes"]) for row in rows],
                         [(scene, hand, rate, steps, "0") for scene, own in (("plane-slide", "50"), ("rod-gap", "100"))
                          for hand in ("script", "hostile:3") for rate, steps in (("own", own), ("25", "25"))])
        self.assertEqual(said, "")

    def test_escapes_are_counted_while_settings_change_at_random(self):
        rows, said = self.table(STUDIES / "escapes.py", "--scene", "rod-gap", "--hand", "hostile:3", "hostile:4",
                                "--settings", "random", "--duration-s", "2")
        self.assertEqual([row["escapes"] for row in rows], ["0", "0"])
        self.assertNotEqual(rows[0]["steps"], rows[1]["steps"], "the rate changes alike beside both hands")
        self.assertEqual(said, "")

    def test_a_run_with_escapes_fails_names_its_command_and_is_recorded(self):
        shutil.copy(STUDIES / "escapes.py", self.folder)
        fake = self.folder / "host-sim"
        fake.write_text(ESCAPING)
        fake.chmod(0o755)
        (self.folder / "programs.py").write_text(f"HOST_SIM = {str(fake)!r}\n")
        rows, said = self.table(self.folder / "escapes.py", "--scene", "rod-gap", "--hand", "hostile:9",
                                "--settings", "random", "--duration-s", "5", "--", "--set", "solver.iterations=3",
                                status=1)
        self.assertEqual(rows[0]["escapes"], "2")
        self.assertEqual((rows[0]["sheets"], rows[0]["ground"], rows[0]["ground_depth_mm"]),
                         ("3", "5", "1.2"))
        self.assertIn(f"escaped: {fake} run rod-gap --clock lockstep --hand hostile:9 --duration 5 --verify "
                      "--settings random:9 --set solver.iterations=3\n", said)
        record = self.folder / "escaped-rod-gap-hostile-9-random-9-own-5.csv"
        self.assertIn(f"to look at it: {fake} play {record}\n", said)
        self.assertTrue(record.exists())
        self.assertIn("in 1 of 1 runs", said)
        # One that ended early has shown nothing.
        os.environ["SIM_S"] = "3"
        self.addCleanup(os.environ.pop, "SIM_S")
        _, said = self.table(self.folder / "escapes.py", "--scene", "rod-gap", "--hand", "script", "--duration-s", "5",
                             status=1)
        self.assertIn("diverged after 3 s", said)

    def test_forces_are_those_of_the_report(self):
        report = self.folder / "report.json"
        subprocess.run([HOST_SIM, "run", "plane-slide", "--clock", "lockstep", "--set", "coupling.stiffness=40",
                        "--report", report], check=True, capture_output=True)
        force = json.loads(report.read_text())["force_N"]["max"]
        rows, _ = self.table(STUDIES / "scene-forces.py", "--scene", "plane-slide", "--", "--set", "coupling.stiffness=40")
        self.assertEqual(float(rows[0]["force_n"]), round(force, 3))
        self.assertEqual(rows[0]["not_wrench_closed"], "0")
        self.assertGreater(float(rows[0]["share_percent"]), 1)

    def test_the_map_is_that_of_one_run_of_rt_core(self):
        options = ["--hold", "1.8", "--duration", "3", "--delays", "0", "20"]
        rows, _ = self.table(STUDIES / "stability.py", "--rate-hz", "100", "--stiffness-n-m", "200", "600", "--", *options)
        subprocess.run([RT_CORE, "stability", "--host-sim", HOST_SIM, "--scene", "curtain-hand", "--out", self.folder,
                        "--rates", "100", "--stiffnesses", "200", "600", *options], check=True, capture_output=True)
        with (self.folder / "stability-curtain-hand.csv").open() as file:
            expected = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
        self.assertEqual(len(expected), 4)
        self.assertEqual([{name: float(row[name]) for name in expected[0]} for row in rows], expected)

    def test_figures_are_on_one_page(self):
        rows, _ = self.table(STUDIES / "reproduce.py", "--figure", "4.14", "4.7", "--folder", "figures")
        self.assertEqual([(row["figure"], row["shows"]) for row in rows], [("4.14", "results"), ("4.7", "results")])
        page = (self.folder / "figures" / "index.html").read_text()
        self.assertLess(0, page.index('id="figure-4.7"'))
        self.assertLess(page.index('id="figure-4.7"'), page.index('id="figure-4.14"'))
        self.assertTrue((self.folder / "figures" / "figure-4.7.csv").exists())

    @unittest.skipUnless(possible() and EMULATED_CABLE.exists(), "network namespaces cannot be made here")
    def test_the_force_over_a_network_is_that_on_one_machine(self):
        rows, _ = self.table(STUDIES / "network.py", "--scene", "gel-block", "--delay-ms", "5", "--loss-percent", "0")
        row = {name: float(value) for name, value in rows[0].items() if name not in ("scene", "machine")}
        # It answers a state that was at least a round trip old; the gel yields no less than on one machine.
        self.assertGreaterEqual(row["age_ms"], 10.0)
        self.assertGreater(row["alone_n"], 0.5)
        self.assertAlmostEqual(row["held_n"], row["alone_n"], delta=0.1 * row["alone_n"])
        self.assertGreater(row["arrived"], 0.9)
        self.assertEqual(row["escapes"], 0)

    def draw(self, rows):
        """What network.py says of this table; the picture is map.png."""
        columns = ("scene", "delay_ms", "jitter_ms", "loss_percent", "error", "held_n", "alone_n")
        (self.folder / "network.csv").write_text("\n".join(",".join(map(str, row)) for row in (columns, *rows)) + "\n")
        return subprocess.run([sys.executable, "-B", STUDIES / "network.py", "--draw", "network.csv", "map.png"],
                              cwd=self.folder, capture_output=True, text=True)

    @unittest.skipUnless(shutil.which("gnuplot"), "gnuplot is not installed")
    def test_a_table_of_the_network_is_drawn_without_runs(self):
        # A hand that touched nothing at the end, and a row with jitter, which is left out.
        drawn = self.draw([("gel-block", "none", 0, 0, 0.01, 1.0, 1.0), ("gel-block", 1, 0, 0, 0.02, 1.0, 1.0),
                           ("gel-block", 5, 0, 0, 1.0, 0.0, 0.0), ("gel-block", 9, 5, 0, 0.1, 1.0, 1.0)])
        self.assertEqual((drawn.returncode, drawn.stdout, drawn.stderr), (0, "", ""))
        self.assertTrue((self.folder / "map.png").read_bytes().startswith(b"\x89PNG"))
        self.assertIn("nothing to draw", self.draw([("gel-block", "none", 0, 0, 0.01, 1.0, 1.0)]).stderr)
        self.assertIn("is no table of this study", self.draw([("gel-block", "far", 0, 0, 0.01, 1.0, 1.0)]).stderr)

    def test_studies_of_this_machine_refuse_others(self):
        for name in ("network.py", "reproduce.py"):
            refused = subprocess.run([sys.executable, "-B", STUDIES / name, "--machines", "lab1"], cwd=self.folder,
                                     capture_output=True, text=True)
            self.assertEqual(refused.returncode, 1)
            self.assertIn("error: this study has no --machines: ", refused.stderr)

    def test_an_unknown_figure_is_named(self):
        rows, said = self.table(STUDIES / "reproduce.py", "--figure", "4.99", status=1)
        self.assertEqual(rows, [])
        self.assertIn("4.99", said)


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
