#!/usr/bin/env python3
"""Plants each kind of violation in a small tree and expects check_includes.py to name it."""
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

CHECK = Path(__file__).with_name("check_includes.py")
README = "# host-sim\n\n```folders\napp   -> scene mesh\nscene -> mesh\nmesh  ->\n```\n"
FILES = {
    "README.md": README,
    "src/main.cpp": '#include "app/run.hpp"\n',
    "src/app/run.hpp": '#include "haptic/sim/scene.hpp"\n#include "mesh/box.hpp"\n',
    "src/scene/scene.cpp": '#include "mesh/box.hpp"\n',
    "src/mesh/box.hpp": "#include <vector>\n",
    "include/haptic/sim/scene.hpp": '#include "haptic/types.hpp"\n',
}


class CheckIncludes(unittest.TestCase):
    def run_with(self, changes: dict[str, str]) -> tuple[int, str]:
        with tempfile.TemporaryDirectory() as folder:
            for name, text in {**FILES, **changes}.items():
                path = Path(folder) / "host-sim" / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            run = subprocess.run([sys.executable, CHECK, folder, "host-sim"], capture_output=True, text=True, check=False)
            return run.returncode, run.stdout + run.stderr

    def test_accepts_a_tree_that_follows_its_table(self):
        self.assertEqual(self.run_with({}), (0, "The includes follow the tables.\n"))

    def test_refuses_an_edge_that_the_table_lacks(self):
        status, text = self.run_with({"src/mesh/box.hpp": '#include "haptic/sim/scene.hpp"\n'})
        self.assertEqual(status, 1)
        self.assertIn("mesh -> scene is not in the table", text)

    def test_refuses_an_edge_that_no_include_needs(self):
        status, text = self.run_with({"src/scene/scene.cpp": "\n"})
        self.assertEqual(status, 1)
        self.assertIn("scene -> mesh, but no include needs it", text)

    def test_refuses_a_table_with_a_cycle(self):
        status, text = self.run_with({"README.md": README.replace("mesh  ->", "mesh  -> app")})
        self.assertEqual(status, 1)
        self.assertIn("folder mesh uses app, which does not stand below it", text)

    def test_refuses_a_folder_that_the_table_lacks(self):
        status, text = self.run_with({"src/view/page.hpp": "\n"})
        self.assertEqual(status, 1)
        self.assertIn("the table lacks the folder view", text)

    def test_refuses_a_public_header_that_belongs_to_no_folder(self):
        status, text = self.run_with({"include/haptic/sim/orphan.hpp": "\n"})
        self.assertEqual(status, 1)
        self.assertIn("orphan.hpp: no source implements it", text)

    def test_refuses_an_include_of_another_process(self):
        status, text = self.run_with({"src/scene/scene.cpp": '#include "haptic/device/board.hpp"\n#include "mesh/box.hpp"\n'})
        self.assertEqual(status, 1)
        self.assertIn("includes haptic/device/board.hpp of firmware-host", text)


if __name__ == "__main__":
    unittest.main()
