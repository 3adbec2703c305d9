"""Fails if two tests have one name: check_test_names.py CTEST BUILD_FOLDER

ctest gives the properties of one, such as its labels, to the other too, which may then never run."""
import collections
import json
import subprocess
import sys


def names_of_two(shown: str) -> list[str]:
    """Of what ctest shows as json-v1: the names that more than one test has."""
    count = collections.Counter(test["name"] for test in json.loads(shown)["tests"])
    return [name for name, times in count.items() if times > 1]


def main() -> int:
    ctest, folder = sys.argv[1:]
    shown = subprocess.run([ctest, "--test-dir", folder, "--show-only=json-v1"], stdout=subprocess.PIPE, check=True)
    if names := names_of_two(shown.stdout):
        print("error: tests with one name: " + ", ".join(names))
    return 1 if names else 0


if __name__ == "__main__":
    sys.exit(main())
