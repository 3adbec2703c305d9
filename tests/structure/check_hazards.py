#!/usr/bin/env python3
"""Checks that each test which the hazard analysis names exists, and that each hazard has one: check_hazards.py ROOT"""
import re
import sys
from pathlib import Path

PAGE = "rt-core/docs/hazards.md"
WITHOUT_TEST = {"H13"}  # electricity: not a matter of software


def existing_tests(root: Path) -> set[str]:
    names = set()
    for source in (root / "tests").rglob("*.cpp"):
        for suite, name in re.findall(r"^TEST(?:_F|_P)?\(\s*(\w+),\s*(\w+)\)", source.read_text(), re.MULTILINE):
            names.add(f"{suite}.{name.removeprefix('DISABLED_')}")
    for lists in (root / "tests").rglob("CMakeLists.txt"):
        names |= set(re.findall(r"add_test\(\s*NAME\s+([\w.]+)", lists.read_text()))
    return names


def problems(page: str, tests: set[str]) -> list[str]:
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in page.splitlines() if line.startswith("| H")]
    hazards = [row[0] for row in rows if len(row) == 6]
    guards = [row for row in rows if len(row) == 3]
    found = []
    if len(hazards) < 2 or len(hazards) != len(set(hazards)):
        found.append("the table of hazards is missing, or has a number twice")
    guarded = set()
    for number, measure, cell in guards:
        names = re.findall(r"`([^`]+)`", cell)
        guarded |= {number} if names else set()
        if number not in hazards:
            found.append(f"{number} ({measure}) is no hazard of the table")
        found += [f"{number}: there is no test {name}" for name in names if name not in tests]
    found += [f"{number} has no test" for number in hazards if number not in guarded | WITHOUT_TEST]
    return found


def main() -> None:
    root = Path(sys.argv[1])
    found = problems((root / PAGE).read_text(), existing_tests(root))
    for problem in found:
        print(f"error: {PAGE}: {problem}", file=sys.stderr)
    sys.exit(1 if found else 0)


if __name__ == "__main__":
    main()
