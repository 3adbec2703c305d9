"""haptic.materials and the virtual tests."""
import unittest

import haptic


class Materials(unittest.TestCase):
    def test_named_ones_have_their_values(self):
        named = haptic.materials()
        self.assertIsInstance(named["silk"], haptic.SheetMaterial)
        self.assertIsInstance(named["ecoflex 00-30"], haptic.SolidMaterial)
        self.assertGreater(named["paper"].bending_stiffness, 10 * named["silk"].bending_stiffness)

    def test_values_are_checked(self):
        with self.assertRaisesRegex(ValueError, "young_modulus is -1"):
            haptic.SolidMaterial(young_modulus=-1.0)
        with self.assertRaisesRegex(ValueError, "poisson_ratio"):
            haptic.SheetMaterial(poisson_ratio=0.6)

    def test_a_bar_has_the_modulus_that_is_asked_for(self):
        for step in (0.002, 0.02):
            measured = haptic.measure_tension(haptic.SolidMaterial(young_modulus=2e4), particles=120, step=step)
            self.assertTrue(measured.at_rest)
            self.assertAlmostEqual(measured.modulus / 2e4, 1.0, delta=0.02)
            self.assertAlmostEqual(measured.poisson_ratio / 0.4, 1.0, delta=0.02)

    def test_a_sheet_has_the_stiffness_that_is_asked_for(self):
        measured = haptic.measure_membrane(haptic.materials()["cotton"], vertices_per_side=17)
        self.assertAlmostEqual(measured.value / haptic.materials()["cotton"].membrane_stiffness, 1.0, delta=0.03)
        with self.assertRaisesRegex(ValueError, "at least 9"):
            haptic.measure_membrane(haptic.materials()["cotton"], vertices_per_side=5)

    def test_a_layer_pushes_back(self):
        shallow, deep = haptic.measure_press(haptic.SolidMaterial(), [0.001, 0.002], particles=300)
        self.assertGreater(deep.force, 1.5 * shallow.force)
        self.assertAlmostEqual(shallow.force / shallow.requested, 1.0, delta=0.25)


if __name__ == "__main__":
    unittest.main()
