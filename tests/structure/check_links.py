#!/usr/bin/env python3
"""Checks the documentation of a source tree: check_links.py ROOT

Every relative link of every Markdown file leads to a file, and its anchor to a heading of that file. The README.md of a top-level
folder has at most 120 lines. Details belong to the folder's docs/. No page holds both sides of an unresolved merge.
"""
import re
import subprocess
import sys
from pathlib import Path

CONFLICT = re.compile(r"^(<{7}|>{7}) ", re.MULTILINE)
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
FOLDERS = ("firmware-host", "host-sim", "rt-core", "shared", "toolchain")


def anchors(page: Path) -> set[str]:
    """The anchors that GitHub and GitLab give to the headings of a page."""
    text = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ +(.*?)\s*$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def main() -> int:
    root = Path(sys.argv[1]).resolve()
    listed = subprocess.run(["git", "ls-files", "--cached", "--others", "--exclude-standard", "*.md"],
                            cwd=root, capture_output=True, text=True, check=False)
    pages = [root / line for line in listed.stdout.splitlines()] or \
        [page for page in root.rglob("*.md") if "node_modules" not in page.parts and "build" not in page.parts]
    problems = []
    for page in (page for page in pages if page.exists()):
        text = re.sub(r"^( {4}|\t).*$", "", page.read_text(), flags=re.MULTILINE)
        if CONFLICT.search(text):
            problems.append(f"{page.relative_to(root)} holds both sides of an unresolved merge")
        for link in LINK.findall(text):
            if re.match(r"[a-z]+:", link):
                continue
            name, _, anchor = link.partition("#")
            target = (page.parent / name).resolve() if name else page
            where = f"{page.relative_to(root)}: link {link}"
            if not target.exists():
                problems.append(f"{where} leads to no file")
            elif anchor and target.suffix == ".md" and anchor not in anchors(target):
                problems.append(f"{where}: {name or page.name} has no heading of that name")
    for folder in FOLDERS:
        readme = root / folder / "README.md"
        lines = len(readme.read_text().splitlines()) if readme.exists() else 0
        if lines > 120:
            problems.append(f"{folder}/README.md has {lines} lines: 120 at most, details belong to {folder}/docs")
    print("\n".join(problems) or f"{len(pages)} pages, every link leads somewhere.")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
