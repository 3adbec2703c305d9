"""haptic/_core.pyi against the compiled module, and what a type checker says with it."""
import os
import re
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

PACKAGE = Path(os.environ["PYTHONPATH"], "haptic")
# What pybind11 makes of each class: its metaclass, and constructors that take anything until they are called.
UNSTATED = r"haptic\._core\.[A-Z]\w+(\.__init__)?"


def mypy(*arguments):
    with tempfile.TemporaryDirectory() as cache:
        return subprocess.run([sys.executable, "-m", *arguments], capture_output=True, text=True, cwd=cache,
                              env={**os.environ, "MYPYPATH": str(PACKAGE.parent)})


class Stubs(unittest.TestCase):
    def test_they_have_what_the_module_has_and_no_more(self):
        with tempfile.NamedTemporaryFile("w") as allowed:
            allowed.write(UNSTATED + "\n")
            allowed.flush()
            checked = mypy("mypy.stubtest", "haptic._core", "--concise", "--ignore-unused-allowlist", "--allowlist",
                           allowed.name)
        self.assertEqual(checked.returncode, 0, checked.stdout + checked.stderr)

    def test_every_argument_of_a_docstring_is_in_the_stub(self):
        import haptic._core as core
        stub = (PACKAGE / "_core.pyi").read_text()
        for owner, methods in (("Simulation", ("step", "step_state", "run", "follow", "change_settings")),
                               (None, ("ccd", "measure_tension", "measure_drape", "measure_press", "load_recording"))):
            for name in methods:
                signature = getattr(getattr(core, owner) if owner else core, name).__doc__.split("\n")[0]
                stated = re.search(rf"def {name}\((.*?)\) ->", stub, re.DOTALL)[1]
                arguments = [a for a in re.findall(r"(\w+): ", signature) if a != "self"]
                self.assertEqual(arguments, re.findall(r"(\w+): ", stated), name)

    def test_the_package_itself_has_types(self):
        checked = mypy("mypy", "--strict", "--package", "haptic")
        self.assertEqual(checked.returncode, 0, checked.stdout)

    def test_a_type_checker_finds_wrong_arguments(self):
        with tempfile.NamedTemporaryFile("w", suffix=".py") as script:
            script.write("import haptic\n"
                         "sim = haptic.Simulation('cloth-drop', verify=True)\n"
                         "height = float(sim.vertices[:, 1].max())\n"
                         "sim.run(steps='ten')\n")
            script.flush()
            checked = mypy("mypy", "--strict", script.name)
        self.assertEqual(re.findall(r":(\d+): error: .*\[(.*)\]", checked.stdout), [("4", "arg-type")], checked.stdout)


if __name__ == "__main__":
    unittest.main()
