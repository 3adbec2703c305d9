"""Presses a block of several materials, and draws the force that the hand feels over time: press.py PICTURE"""

import sys

import haptic
import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

MATERIALS = ("liver", "gelatin 10 %", "ecoflex 00-30")


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: press.py PICTURE")
    for name in MATERIALS:
        sim = haptic.Simulation("gel-block", {"model.material": name}, verify=True)
        block = sim.vertices  # a view: it follows the steps
        height = block[:, 1].max()
        lowest = height
        force = []
        while sim.time < 2.0:
            step = sim.step()  # the scene's script; step(position, orientation) moves the hand yourself
            force.append(step.hand_force[1])
            lowest = min(lowest, block[sim.triangles[sim.contacts.triangle], 1].min(initial=height))
            assert step.crossings == 0
        print(f"{name:14} {haptic.materials()[name].young_modulus / 1e3:5.1f} kPa: "
              f"dented by {1e3 * (height - lowest):4.1f} mm, {max(force):.2f} N at the hand")
        pyplot.plot([k * step.step for k in range(len(force))], force, label=name)
    pyplot.xlabel("time, s")
    pyplot.ylabel("force at the hand, N")
    pyplot.legend()
    pyplot.gcf().set_size_inches(5, 3.75)
    pyplot.savefig(sys.argv[1], dpi=80)


if __name__ == "__main__":
    main()
