"""Fails if two tests have one name: check_test_names.py CTEST BUILD_FOLDER

ctest gives the properties of one, such as its labels, to the other too, which may then never run."""
import collections
import json
import subprocess
import sys

ctest, folder = sys.argv[1:]
shown = subprocess.run([ctest, "--test-dir", folder, "--show-only=json-v1"], stdout=subprocess.PIPE, check=True)
tests = json.loads(shown.stdout)["tests"]
count = collections.Counter(test["name"] for test in tests)
if not tests:
    sys.exit(f"error: {folder} has no tests")
if twice := [name for name, times in count.items() if times > 1]:
    sys.exit("error: tests with one name: " + ", ".join(twice))
