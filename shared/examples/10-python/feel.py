"""Simulates a scene in real time for rt-core, until rt-core ends: feel.py SCENE

host-sim run SCENE --clock real in thirty lines: a start for what host-sim does not do.
"""

import sys
import time

import haptic

WAIT_S = 10.0  # for rt-core


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: feel.py SCENE")
    sim = haptic.Simulation(sys.argv[1], verify=True)
    step_ns = round(1e9 * sim.settings["solver.step"])
    steps = escapes = 0
    peak = 0.0
    with haptic.Session("default") as session:
        begin_ns = deadline_ns = haptic.now_ns()
        state = None
        while not session.peer["closed"]:
            state = session.read() or state
            if state is not None:
                step = sim.step_state(state, deadline_ns)
                session.publish(sim.frame)
                steps += 1
                escapes += int(step.crossings)
                peak = max(peak, abs(state.force).max())
            elif haptic.now_ns() - begin_ns > 1e9 * WAIT_S:
                sys.exit("rt-core does not run")
            deadline_ns += step_ns
            time.sleep(max(0, deadline_ns - haptic.now_ns()) * 1e-9)
    print(f"{steps} steps, {escapes} escapes, {peak:.1f} N at most")


if __name__ == "__main__":
    main()
