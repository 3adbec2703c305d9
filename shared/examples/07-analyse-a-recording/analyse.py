"""Analyses a recording of host-sim: analyse.py RECORDING.csv

Prints when the tool touched, the largest force, and the stiffness that the hand felt: the slope of the line of least
squares through zero of the force over the distance between hand and proxy.
"""

import csv
import math
import sys


def rows_of(path):
    """The steps of a recording as dictionaries of numbers. Lines with # before the header are notes."""
    with open(path, newline="") as file:
        lines = (line for line in file if not line.startswith("#"))
        for row in csv.DictReader(lines):
            yield {name: float(value) for name, value in row.items()}


def distance(row, a, b):
    return math.dist([row[f"{a}_{axis}_m"] for axis in "xyz"], [row[f"{b}_{axis}_m"] for axis in "xyz"])


def main():
    if len(sys.argv) != 2:
        sys.exit("usage: analyse.py RECORDING.csv")
    steps = list(rows_of(sys.argv[1]))
    contact = [row for row in steps if row["in_contact"] > 0]
    if not contact:
        sys.exit(f"{sys.argv[1]}: the tool never touches")

    depth = [distance(row, "proxy", "hip") for row in contact]  # m, scene
    force = [math.hypot(row["fx_n"], row["fy_n"], row["fz_n"]) for row in contact]  # N, at the hand
    peak = max(range(len(contact)), key=lambda i: force[i])
    stiffness = sum(d * f for d, f in zip(depth, force)) / sum(d * d for d in depth)

    print(f"in contact  {len(contact)} of {len(steps)} steps, first at {contact[0]['time_s']:.3f} s")
    print(f"peak force  {force[peak]:.2f} N at {contact[peak]['time_s']:.3f} s, {depth[peak] * 1e3:.1f} mm deep")
    print(f"stiffness   {stiffness:.0f} N at the hand per metre in the scene")


if __name__ == "__main__":
    main()
