"""A hand of 0.1 kg rests on a block of gel, and what it feels comes late. When does it begin to swing?"""

from collections import deque

import haptic
import numpy as np
from haptic import study

MASS = 0.1  # kg, of hand and grip
DAMPING = 2.0  # N s/m, of the arm
PUSH = 0.5  # N, downward


def hold(material, stiffness, delay_ms):
    """How far a hand swings that rests on a block."""
    # One thread: the study has a run on each processor.
    sim = haptic.Simulation("gel-block", {"model.material": material, "coupling.stiffness": stiffness,
                                          "solver.step": 0.002, "solver.threads": 1})
    step = sim.step()
    position, velocity = step.device_position.copy(), np.zeros(3)
    felt = deque([np.zeros(3)] * (1 + round(delay_ms * 1e-3 / step.step)))
    heights = []
    while sim.time < 3.0:
        felt.append(step.hand_force)
        force = felt.popleft() + [0.0, -PUSH, 0.0]
        velocity += step.step * (force - DAMPING * velocity) / MASS
        position += step.step * velocity
        step = sim.step(position)
        heights.append(position[1])
    last = np.array(heights[len(heights) // 2:])
    return {"depth_mm": 1e3 * (heights[0] - last.mean()), "swing_mm": 1e3 * np.ptp(last)}


if __name__ == "__main__":
    study.main(hold, material=["liver", "gelatin 10 %", "ecoflex 00-30"], stiffness=[100, 400],
               delay_ms=[0, 10, 20])
