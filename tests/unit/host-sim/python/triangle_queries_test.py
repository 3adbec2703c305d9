"""haptic.ccd against equations and the command line."""
import os
import subprocess
import unittest

import numpy as np

import haptic


def random_queries(count, seed):
    random = np.random.default_rng(seed)
    return (random.uniform(-1, 1, (count, 3)), random.uniform(0.05, 0.5, count),
            random.uniform(-2, 2, (count, 3, 3)), random.uniform(-2, 2, (count, 3, 3)))


class TriangleQueries(unittest.TestCase):
    def test_first_touch_of_a_falling_plane_is_exact(self):
        # A large triangle falls from height 1 to -1 onto spheres at the origin: it touches at t = (1 - r) / 2.
        radii = np.linspace(0.1, 0.9, 9)
        start = np.tile([[-5.0, 1.0, -5.0], [5.0, 1.0, -5.0], [0.0, 1.0, 8.0]], (9, 1, 1))
        end = start - [0.0, 2.0, 0.0]
        answers = haptic.ccd(np.zeros((9, 3)), radii, start, end)
        self.assertTrue((answers.touched == haptic.FEATURES.index("face")).all())
        np.testing.assert_allclose(answers.touch_time, (1 - radii) / 2, atol=1e-4)
        np.testing.assert_allclose(answers.passage_time, 0.5, atol=1e-12)
        np.testing.assert_allclose(answers.normal, np.tile([0.0, -1.0, 0.0], (9, 1)), atol=1e-12)
        # Never on the other side: below the triangle's last height, by the radius.
        self.assertTrue((answers.secure_position[:, 1] <= -1.0 - 0.999 * radii).all())

    def test_first_touch_of_a_vertex_solves_the_quadratic(self):
        # A sliver whose tip leads: |a + t d| = r.
        random = np.random.default_rng(5)
        tip = random.uniform(1.0, 2.0, (200, 3))
        way = -2.0 * tip + random.uniform(-0.1, 0.1, (200, 3))
        back = 0.3 * tip + np.cross(tip, [0.0, 0.0, 1.0]) * 0.01
        other = 0.3 * tip - np.cross(tip, [0.0, 0.0, 1.0]) * 0.01
        start = np.stack([tip, tip + back, tip + other], axis=1)
        answers = haptic.ccd(np.zeros((200, 3)), 0.3, start, start + way[:, None, :])
        a, b, c = (way**2).sum(1), 2 * (tip * way).sum(1), (tip**2).sum(1) - 0.3**2
        expected = (-b - np.sqrt(b * b - 4 * a * c)) / (2 * a)
        self.assertTrue((answers.touched == haptic.FEATURES.index("vertex")).all())
        np.testing.assert_allclose(answers.touch_time, expected, atol=1e-4)

    def test_nothing_is_reported_where_nothing_touches(self):
        answers = haptic.ccd([[0, 0, 9.0]], 0.5, np.zeros((1, 3, 3)), np.ones((1, 3, 3)))
        self.assertEqual(answers.touched[0], 0)
        self.assertTrue(np.isnan(answers.touch_time[0]) and np.isnan(answers.passage_time[0]))
        np.testing.assert_array_equal(answers.secure_position[0], [0, 0, 9])

    def test_the_answers_are_those_of_the_command_line(self):
        centers, radii, start, end = random_queries(300, 1)
        lines = "\n".join(",".join(repr(float(x)) for x in np.concatenate([c, [r], a.ravel(), b.ravel()]))
                          for c, r, a, b in zip(centers, radii, start, end))
        output = subprocess.run([os.environ["HOST_SIM"], "query", "ccd"], input=lines, check=True, capture_output=True,
                                text=True).stdout.splitlines()
        answers = haptic.ccd(centers, radii, start, end)
        self.assertGreater((answers.touched > 0).sum(), 100)
        for answer, line in zip(answers, output, strict=True):
            kind, *numbers = line.split(",")
            self.assertEqual(haptic.FEATURES[answer.touched], kind)
            expected = [float(x) if x else np.nan for x in numbers]
            np.testing.assert_array_equal([answer.touch_time, answer.passage_time, *answer.normal,
                                           *answer.secure_position], expected)

    def test_arguments_are_checked(self):
        one = np.zeros((1, 3, 3))
        with self.assertRaisesRegex(ValueError, r"end must have the shape \(1, 3, 3\), found \(2, 3, 3\)"):
            haptic.ccd([[0, 0, 0]], 1.0, one, np.zeros((2, 3, 3)))
        with self.assertRaisesRegex(ValueError, "radii must be greater than 0"):
            haptic.ccd([[0, 0, 0]], 0.0, one, one)
        with self.assertRaisesRegex(ValueError, "start has a number that is not finite, at index 4"):
            bad = one.copy()
            bad[0, 1, 1] = np.nan
            haptic.ccd([[0, 0, 0]], 1.0, bad, one)


if __name__ == "__main__":
    unittest.main()
