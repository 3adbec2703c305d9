"""Tests of run_page: it runs the commands of a page in order, and finds each kind of defect."""

import importlib.machinery
import importlib.util
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

RUN_PAGE = Path(__file__).with_name("run_page")


class RunPage(unittest.TestCase):
    def run_text(self, text: str) -> subprocess.CompletedProcess[str]:
        with tempfile.TemporaryDirectory() as folder:
            page = Path(folder) / "page.md"
            page.write_text(text)
            return subprocess.run([sys.executable, RUN_PAGE, "--built", folder, page], capture_output=True, text=True)

    def refuses(self, text: str, problem: str) -> None:
        result = self.run_text(text)
        self.assertEqual(result.returncode, 1)
        self.assertIn(problem, result.stderr)

    def test_runs_blocks_in_order_in_one_folder_that_shows_the_repository(self):
        text = "    test -f README.md\n    echo 1 > build/a\n\n    cat build/a\n\n```text\n1\n```\n"
        self.assertEqual(self.run_text(text).returncode, 0)

    def test_leaves_out_what_would_build_the_programs_again(self):
        self.assertEqual(self.run_text("    ./toolchain/absent\n\nand\n\n    true\n").returncode, 0)

    def test_refuses_a_command_that_fails(self):
        self.refuses("    false\n    true\n", "ended with status 1")

    def test_refuses_output_without_a_line_of_the_page(self):
        self.refuses("    echo 2 N at 3 s\n\n```text\n4 N at ...\n```\n", "did not print this line: 4 N at ...")

    def test_refuses_output_in_another_order(self):
        self.refuses("    echo b; echo a\n\n```text\na\nb\n```\n", "did not print this line: b")

    def test_refuses_a_view_that_serves_nothing(self):
        self.refuses("    echo --view\n", "has served no page")

    def test_refuses_a_page_without_commands(self):
        self.refuses("# Title\n\n```text\nx\n```\n", "has no commands")

    def test_a_folder_of_its_own_shows_the_files_and_keeps_what_is_written(self):
        sys.dont_write_bytecode = True  # nothing is written to the source tree
        loader = importlib.machinery.SourceFileLoader("run_page", str(RUN_PAGE))
        run_page = importlib.util.module_from_spec(importlib.util.spec_from_loader("run_page", loader))
        sys.modules["run_page"] = run_page
        loader.exec_module(run_page)
        with tempfile.TemporaryDirectory() as folder:
            repository, shown = Path(folder) / "repository", Path(folder) / "shown"
            (repository / "examples/one/build").mkdir(parents=True)
            (repository / "examples/two").mkdir()
            (repository / "examples/one/scene").write_text("1")
            (repository / "examples/two/scene").write_text("2")
            shown.mkdir()
            (shown / "examples").symlink_to(repository / "examples")
            run_page.own_folder(shown, Path("examples/one"))
            # A neighbour as "../two" of a command in the folder.
            here = subprocess.run(["bash", "-c", "cat scene ../two/scene; test ! -e build; mkdir build; touch build/x y"],
                                  cwd=shown / "examples/one", capture_output=True, text=True)
            self.assertEqual((here.returncode, here.stdout), (0, "12"), here.stderr)
            self.assertEqual(sorted(p.name for p in (repository / "examples/one").rglob("*")), ["build", "scene"])


if __name__ == "__main__":
    unittest.main()
