"""haptic.Simulation against the command line, and what only Python shows: views, threads, interrupts, errors."""
import os
import re
import signal
import subprocess
import tempfile
import threading
import unittest
import warnings
import weakref
from pathlib import Path

import numpy as np

import haptic

HOST_SIM = os.environ["HOST_SIM"]


def run_command(scene, *options):
    """State hash at the end of `host-sim run`."""
    output = subprocess.run([HOST_SIM, "run", scene, *options], check=True, capture_output=True, text=True).stdout
    return int(re.search(r"^ *state *([0-9a-f]{16})$", output, re.MULTILINE)[1], 16)


def address_of(array):
    return array.__array_interface__["data"][0]


class RunsLikeTheCommandLine(unittest.TestCase):
    def test_the_script_ends_in_the_same_state(self):
        for scene, steps in (("cloth-drop", 130), ("four-fish", 60), ("fish-grab", 40)):
            with self.subTest(scene):
                sim = haptic.Simulation(scene)
                sim.run(steps)
                self.assertEqual(sim.state_hash, run_command(scene, "--steps", str(steps)))

    def test_settings_are_those_of_set(self):
        settings = {"model.material": "silk", "solver.step": 0.005, "collisions.ground": False,
                    "workspace.offset": np.array([0.0, 0.1, 0.0])}
        sim = haptic.Simulation("cloth-drop", settings)
        sim.run(steps=50)
        self.assertEqual(sim.state_hash, run_command(
            "cloth-drop", "--steps", "50", "--set", "model.material='silk'", "--set", "solver.step=0.005", "--set",
            "collisions.ground=false", "--set", "workspace.offset=[0.0, 0.1, 0.0]"))
        self.assertNotEqual(sim.state_hash, run_command("cloth-drop", "--steps", "50"))

    def test_a_recording_leads_to_the_same_state(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "grab.csv")
            state = run_command("fish-grab", "--steps", "80", "--record", str(file))
            recording = haptic.load_recording(file)
        sim = haptic.Simulation("fish-grab")
        run = sim.follow(haptic.poses(recording), curl=recording.curl, buttons=recording.buttons)
        self.assertEqual(sim.state_hash, state)
        np.testing.assert_array_equal(run.hand_force[:, 1], recording.fy_n)
        np.testing.assert_allclose(run.time, recording.time_s, atol=1e-9)

    def test_single_steps_are_those_of_a_run(self):
        together = haptic.Simulation("plane-slide")
        run = together.run(steps=30)
        one_by_one = haptic.Simulation("plane-slide")
        for k in range(30):
            step = one_by_one.step()
            self.assertEqual(step.time, run.time[k])
            np.testing.assert_array_equal(step.force, run.force[k])
        self.assertEqual(one_by_one.state_hash, together.state_hash)
        by_hand = haptic.Simulation("plane-slide")
        for row in run:
            by_hand.step(row.device_position, row.device_orientation)
        self.assertEqual(by_hand.state_hash, together.state_hash)

    def test_a_run_has_the_scenes_own_duration(self):
        sim = haptic.Simulation("plane-slide")
        run = sim.run()
        self.assertEqual(len(run) * run.step[0], sim.time)
        self.assertEqual(len(sim.run(duration=10 * run.step[0])), 10)


class ViewsFollowTheSimulation(unittest.TestCase):
    def setUp(self):
        self.sim = haptic.Simulation("cloth-drop")

    def test_they_are_its_memory(self):
        self.sim.run(steps=20)
        views = {"vertices": self.sim.vertices, "position": self.sim.particles.position,
                 "velocity": self.sim.particles.velocity}
        before = {name: (address_of(view), view.copy()) for name, view in views.items()}
        self.sim.run(steps=5)
        now = {"vertices": self.sim.vertices, "position": self.sim.particles.position,
               "velocity": self.sim.particles.velocity}
        for name, view in views.items():
            with self.subTest(name):
                self.assertEqual(address_of(now[name]), before[name][0])
                self.assertFalse(np.array_equal(view, before[name][1]))
                np.testing.assert_array_equal(view, now[name])

    def test_they_are_read_only(self):
        for view in (self.sim.vertices, self.sim.triangles, self.sim.particles.mass, self.sim.frame,
                     self.sim.bodies[0].triangles):
            self.assertFalse(view.flags.owndata)
            with self.assertRaises(ValueError):
                view[...] = 0

    def test_they_keep_the_simulation(self):
        gone = weakref.ref(self.sim.vertices)
        self.assertIsNone(gone())
        positions, bodies = self.sim.particles.position, self.sim.bodies
        expected = positions.copy()
        del self.sim
        np.testing.assert_array_equal(positions, expected)
        self.assertEqual(len(bodies[0].rest_vertices), 1089)

    def test_bodies_share_them(self):
        sim = haptic.Simulation("four-fish")
        self.assertEqual([body.name for body in sim.bodies], 4 * ["fish"])
        self.assertEqual(sum(len(sim.vertices[body.vertices]) for body in sim.bodies), len(sim.vertices))
        self.assertEqual(sum(len(sim.particles.mass[body.particles]) for body in sim.bodies), len(sim.particles))
        for body in sim.bodies:
            self.assertTrue(body.closed)
            self.assertLess(body.triangles.max(), len(sim.vertices[body.vertices]))
        self.assertEqual(sum(len(body.triangles) for body in sim.bodies), len(sim.triangles))

    def test_orientations_are_unit_quaternions_with_w_first(self):
        np.testing.assert_array_equal(self.sim.particles.orientation, np.tile([1.0, 0, 0, 0], (1089, 1)))
        self.sim.run(steps=100)
        np.testing.assert_allclose(np.linalg.norm(self.sim.particles.orientation, axis=1), 1.0, atol=1e-12)


class ContactsBalance(unittest.TestCase):
    def test_their_forces_add_up_to_that_on_the_tool(self):
        sim = haptic.Simulation("cloth-drop")
        run = sim.run(steps=200)
        contacts, last = sim.contacts, run[-1]
        self.assertTrue(last.in_contact)
        self.assertGreater(len(contacts), 0)
        np.testing.assert_allclose(np.linalg.norm(contacts.normal, axis=1), 1.0, atol=1e-12)
        np.testing.assert_allclose((contacts.force[:, None] * contacts.normal).sum(axis=0), last.force,
                                   atol=1e-9 * np.linalg.norm(last.force))
        touched = sim.vertices[sim.triangles[contacts.triangle]].mean(axis=1)
        distance = np.linalg.norm(touched - sim.proxies.position[contacts.proxy], axis=1)
        self.assertLess(distance.max(), 2 * sim.proxies.radius.max())

    def test_the_frame_carries_them(self):
        sim = haptic.Simulation("cloth-drop")
        sim.run(steps=200)
        proxy = sim.frame["proxies"][0]
        self.assertGreaterEqual(proxy["plane_count"], 1)
        self.assertEqual(sim.frame["proxy_count"], len(sim.proxies))
        np.testing.assert_allclose(proxy["planes"]["normal"][0] @ proxy["planes"]["normal"][0], 1.0, atol=1e-6)


class SettingsChange(unittest.TestCase):
    def test_live_settings(self):
        sim = haptic.Simulation("cloth-drop")
        sim.change_settings({"coupling.stiffness": 50, "contact.method": "thesis"})
        self.assertEqual(sim.settings["coupling.stiffness"], 50.0)
        self.assertEqual(sim.settings["contact.method"], "thesis")
        with self.assertRaisesRegex(ValueError, "stiffness"):
            sim.change_settings({"coupling.stiffness": -1})
        with self.assertRaisesRegex(ValueError, "complete, thesis"):
            sim.change_settings({"contact.method": "best"})
        with self.assertRaisesRegex(KeyError, "coupling.stiffness"):
            sim.change_settings({"model.mass": 1.0})
        self.assertEqual(sim.settings["coupling.stiffness"], 50.0)


class ThreadsAndSignals(unittest.TestCase):
    def test_steps_release_the_interpreter(self):
        sim = haptic.Simulation("cloth-drop")
        worker = threading.Thread(target=sim.run, args=(400,))
        worker.start()
        turns = 0
        while worker.is_alive():
            turns += 1
        worker.join()
        # A step is some hundred times as long as a turn. With the lock there would be a few at the start.
        self.assertGreater(turns, 10_000)
        self.assertEqual(sim.steps, 400)

    def test_two_threads_do_not_step_one_simulation(self):
        sim = haptic.Simulation("cloth-drop")
        refused = threading.Event()
        running = threading.Event()

        def keep_running():
            while not refused.is_set():
                running.set()
                try:
                    sim.run(steps=10)
                except RuntimeError as error:
                    self.assertIn("another thread", str(error))

        worker = threading.Thread(target=keep_running)
        worker.start()
        running.wait()
        try:
            with self.assertRaisesRegex(RuntimeError, "another thread"):
                for _ in range(100_000):
                    sim.step()
        finally:
            refused.set()
            worker.join()

    def test_an_interrupt_ends_a_run(self):
        sim = haptic.Simulation("plane-slide")
        timer = threading.Timer(0.2, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with self.assertRaises(KeyboardInterrupt):
            sim.run(duration=1e5)
        timer.join()
        before = sim.steps
        self.assertGreater(before, 0)
        sim.step()
        self.assertEqual(sim.steps, before + 1)

    def test_progress_of_building_is_told(self):
        shares = []
        haptic.Simulation("four-fish", progress=shares.append)
        self.assertGreater(len(shares), 10)
        self.assertEqual(shares, sorted(shares))
        self.assertTrue(all(0.0 <= share <= 1.0 for share in shares))

        def stop(share):
            raise InterruptedError("enough")

        with self.assertRaises(InterruptedError):
            haptic.Simulation("four-fish", progress=stop)


class Verification(unittest.TestCase):
    def test_what_the_thesis_method_lets_through_is_counted(self):
        thesis = {"contact.method": "thesis", "contact.pop_out": "thesis"}
        for settings, passages in (({}, False), (thesis, True)):
            sim = haptic.Simulation("popout-fan", {"solver.step": 0.033, **settings}, verify=True)
            self.assertEqual(sim.run(duration=4.0).crossings.any(), passages)

    def test_vertices_below_the_ground_are_counted(self):
        settings = {"collisions.ground_height": 100.0}
        steps = {verify: haptic.Simulation("cloth-drop", settings, verify=verify).run(1) for verify in (False, True)}
        self.assertEqual(steps[True].below_ground[0], 1089)
        self.assertAlmostEqual(steps[True].ground_depth[0], 90.0, delta=0.1)
        self.assertEqual((steps[False].below_ground[0], steps[False].ground_depth[0]), (0, 0.0))
        for name in ("sheet_crossings", "solid_crossings", "other_crossings"):
            self.assertEqual(steps[True][name][0], 0)


class ErrorsSayWhatToDo(unittest.TestCase):
    def test_scenes(self):
        with self.assertRaisesRegex(haptic.SceneError, "built in are: .*cloth-drop"):
            haptic.Simulation("cloth")
        with self.assertRaisesRegex(haptic.SceneError, "solver.step"):
            haptic.Simulation("cloth-drop", {"solver.stepp": 0.01})
        with self.assertRaisesRegex(haptic.SceneError, "must be a number"):
            haptic.Simulation("cloth-drop", {"solver.step": "fast"})
        with self.assertRaisesRegex(TypeError, "solver.step must be"):
            haptic.Simulation("cloth-drop", {"solver.step": None})
        self.assertTrue(issubclass(haptic.SceneError, ValueError))

    def test_inputs(self):
        sim = haptic.Simulation("plane-slide")
        with self.assertRaisesRegex(ValueError, r"shape \(3\), found \(2\)"):
            sim.step([0.0, 0.0])
        with self.assertRaisesRegex(ValueError, "finite"):
            sim.step([0.0, 0.0, np.nan])
        with self.assertRaisesRegex(ValueError, "unit quaternion"):
            sim.step([0.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0])
        with self.assertRaisesRegex(ValueError, "curl must be 0"):
            sim.step([0.0, 0.0, 0.0], curl=1.5)
        with self.assertRaisesRegex(TypeError, "need a position"):
            sim.step(curl=0.5)
        with self.assertRaisesRegex(ValueError, r"shape \(N, 7\), found \(4, 5\)"):
            sim.follow(np.zeros((4, 5)))
        with self.assertRaisesRegex(ValueError, "row 2 of poses"):
            sim.follow([[0, 0, 0], [0, 0, 0], [0, np.inf, 0]])
        with self.assertRaisesRegex(ValueError, r"buttons must have the shape \(2\)"):
            sim.follow(np.zeros((2, 3)), buttons=[1])
        with self.assertRaisesRegex(TypeError, "exclude"):
            sim.run(steps=1, duration=1.0)
        self.assertEqual(sim.steps, 0)

    def test_notices_are_warnings(self):
        with tempfile.NamedTemporaryFile("w", suffix=".toml") as file, warnings.catch_warnings(record=True) as caught:
            file.write("[model]\ngenerator = \"cloth\"\nlink_stiffness = 0.5\n")
            file.flush()
            warnings.simplefilter("always")
            haptic.Simulation(file.name)
        self.assertRegex(str(caught[0].message), "model.link_stiffness|:3: ")

    def test_recordings(self):
        with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
            file.write("time_s,x_m\n0,1\n1,two\n")
            file.flush()
            with self.assertRaisesRegex(haptic.RecordingError, r"3.*x_m|x_m.*3"):
                haptic.load_recording(file.name)


if __name__ == "__main__":
    unittest.main()
