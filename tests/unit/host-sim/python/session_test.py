"""haptic.Session and haptic.Observer: the rings, from both ends."""
import os
import unittest

import numpy as np

import haptic


def floor(**changes):
    frame = haptic.contact_frame(stiffness=500.0, step_ns=1_000_000)
    frame["proxies"]["plane_count"][0] = 1
    frame["proxies"]["planes"]["normal"][0, 0] = 0.0, 1.0, 0.0
    for name, value in changes.items():
        frame[name] = value
    return frame


class Sessions(unittest.TestCase):
    def setUp(self):
        self.name = f"python-{os.getpid()}-{self._testMethodName[5:30]}"

    def test_observers_see_what_is_published(self):
        observer = haptic.Observer(self.name)
        self.assertEqual(len(observer.frames()), 0)
        with haptic.Session(self.name) as session:
            seen = haptic.Observer(self.name)
            sequences = [session.publish(floor(body_work=k)) for k in range(5)]
            frames = seen.frames()
            np.testing.assert_array_equal(frames.sequence, sequences)
            np.testing.assert_array_equal(frames.body_work, range(5))
            np.testing.assert_array_equal(frames.proxies[:, 0].planes[:, 0].normal, np.tile([0.0, 1.0, 0.0], (5, 1)))
            self.assertEqual(len(seen.frames()), 0)
            self.assertGreater(frames.publish_time_ns[0], 0)

    def test_a_simulations_frame_can_be_published(self):
        sim = haptic.Simulation("plane-slide")
        sim.run(steps=20)
        with haptic.Session(self.name) as session:
            self.assertEqual(session.publish(sim.frame), 1)

    def test_invalid_frames_are_refused_with_their_defect(self):
        with haptic.Session(self.name) as session:
            with self.assertRaisesRegex(ValueError, "normal is not of unit length"):
                frame = floor()
                frame["proxies"]["planes"]["normal"][0, 0] = 0.0, 2.0, 0.0
                session.publish(frame)
            with self.assertRaisesRegex(ValueError, "step"):
                session.publish(floor(step_ns=0))
            with self.assertRaises(TypeError):
                session.publish(np.zeros(1))
            with self.assertRaisesRegex(ValueError, "one contact frame"):
                session.publish(np.stack([floor(), floor()]))
            self.assertEqual(session.publish(floor()), 1)

    def test_a_session_has_one_simulation(self):
        with haptic.Session(self.name) as session:
            self.assertIsNone(session.read())
            self.assertEqual(session.peer["pid"], 0)
            with self.assertRaisesRegex(haptic.SessionError, self.name):
                haptic.Session(self.name)
        haptic.Session(self.name).close()
        with self.assertRaisesRegex(ValueError, "closed"):
            session.read()
        with self.assertRaisesRegex(haptic.SessionError, "must be 1 to 64"):
            haptic.Session("../../etc")

    def test_frames_are_those_of_the_c_interface(self):
        # Sizes of frames.h.
        self.assertEqual(haptic.CONTACT_FRAME.itemsize, 112 + 64 * 232 + 18528 * 4)
        self.assertEqual(haptic.DEVICE_STATE.itemsize, 352)
        self.assertEqual(haptic.DEVICE_STATE.fields["safety_state"][1], 336)
        with self.assertRaisesRegex(ValueError, "1 to 64"):
            haptic.contact_frame(stiffness=1.0, step_ns=1, proxies=65)

    def test_a_device_state_moves_a_simulation(self):
        state = np.zeros(1, haptic.DEVICE_STATE)
        state["orientation"][0] = 1.0, 0.0, 0.0, 0.0
        state["position"][0] = 0.01, 0.02, 0.0
        sim = haptic.Simulation("plane-slide")
        step = sim.step_state(state, haptic.now_ns())
        np.testing.assert_array_equal(step.device_position, [0.01, 0.02, 0.0])
        self.assertEqual(haptic.describe_state(state)["safety_state"], "disarmed")
        with self.assertRaisesRegex(ValueError, "unit quaternion"):
            sim.step_state(np.zeros(1, haptic.DEVICE_STATE), haptic.now_ns())


if __name__ == "__main__":
    unittest.main()
