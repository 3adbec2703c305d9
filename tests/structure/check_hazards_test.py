#!/usr/bin/env python3
"""check_hazards.py finds a test that does not exist, a hazard without a test and a guard without a hazard."""
import sys

sys.dont_write_bytecode = True  # nothing is written to the source tree
from check_hazards import problems

HAZARDS = "| H1 | force | a | high | P | low |\n| H2 | heat | b | high | P | low |\n"
TESTS = {"A.Limits", "B.Cools"}

assert problems(HAZARDS + "| H1 | m | `A.Limits` |\n| H2 | m | `B.Cools` |\n", TESTS) == []
assert problems(HAZARDS + "| H1 | m | `A.Limit` |\n| H2 | m | `B.Cools` |\n", TESTS) == ["H1: there is no test A.Limit"]
assert problems(HAZARDS + "| H1 | m | `A.Limits` |\n", TESTS) == ["H2 has no test"]
assert problems(HAZARDS + "| H1 | m | `A.Limits` |\n| H2 | m | |\n", TESTS) == ["H2 has no test"]
assert "H3 (m) is no hazard of the table" in problems(HAZARDS + "| H3 | m | `B.Cools` |\n", TESTS)
assert problems("", TESTS) == ["the table of hazards is missing, or has a number twice"]
