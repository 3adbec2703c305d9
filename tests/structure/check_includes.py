#!/usr/bin/env python3
"""Checks that the includes of a top-level folder follow the dependency table in its README.

Usage: check_includes.py ROOT [FOLDER ...]

The README of each folder has a fenced block that begins with "```folders". Each line names a folder of src/ and, after "->", the folders
that it may use. A folder may only use folders that stand below it in the block, so the table cannot describe a cycle. The check fails
when an include needs an edge that the table does not have, when the table has an edge that no include needs, when a folder of src/ is
missing from it, or when a top-level folder includes another one against the architecture (everything uses shared, rt-core uses the
public headers of firmware-host, host-sim uses neither).

A public header (FOLDER/include/) belongs to the folder of src/ that implements it, found by its name. HEADER_ONLY lists those that
nothing implements.
"""
import re
import sys
from pathlib import Path

NAMESPACES = {"host-sim": "haptic/sim/", "rt-core": "haptic/rt/", "firmware-host": "haptic/device/"}
MAY_USE = {"host-sim": {"shared"}, "rt-core": {"shared", "firmware-host"}, "firmware-host": {"shared"}}
HEADER_ONLY = {
    "host-sim": {"contact": "contact", "coupling": "tool", "mesh": "mesh", "progress": "mesh", "scene_body": "tool",
                 "tool_material": "tool"},
    "firmware-host": {"board": "boards", "board_options": "boards", "button_track": "emulated"},
    "rt-core": {},
}
INCLUDE = re.compile(r'^\s*#\s*include\s+["<]([^">]+)[">]', re.MULTILINE)


def table(readme: Path) -> dict[str, list[str]]:
    """Folders and what each may use, in the order of the README's block."""
    match = re.search(r"^```folders\n(.*?)^```", readme.read_text(), re.MULTILINE | re.DOTALL)
    if not match:
        sys.exit(f"{readme}: no block that begins with ```folders")
    result: dict[str, list[str]] = {}
    for line in match.group(1).splitlines():
        if line.strip():
            folder, _, used = line.partition("->")
            result[folder.strip()] = used.split()
    return result


def folder_of(source: Path, src: Path) -> str:
    """The folder of src/ that a source belongs to: its first path component, "" for a file directly in src/."""
    parts = source.relative_to(src).parts
    return parts[0] if len(parts) > 1 else ""


def check(root: Path, top: str) -> list[str]:
    src, include = root / top / "src", root / top / "include"
    allowed = table(root / top / "README.md")
    order = list(allowed)
    problems = [f"{top}/README.md: folder {f} uses {u}, which does not stand below it"
                for f, used in allowed.items() for u in used if u not in order[order.index(f) + 1:]]

    sources = sorted(p for p in [*src.rglob("*"), *include.rglob("*")] if re.search(r"\.(hpp|cpp|h|in)$", p.name))
    owner = {p: folder_of(p, src) for p in sources if p.is_relative_to(src)}
    implemented = {p.name.split(".")[0]: f for p, f in owner.items() if ".cpp" in p.name}
    for header in (p for p in sources if p.is_relative_to(include)):
        stem = header.stem
        folder = HEADER_ONLY[top].get(stem) or implemented.get(stem)
        if folder is None:
            problems.append(f"{header.relative_to(root)}: no source implements it, and HEADER_ONLY does not list it")
        else:
            owner[header] = folder

    needed: dict[tuple[str, str], str] = {}
    for source, folder in owner.items():
        for name in INCLUDE.findall(source.read_text()):
            for other, prefix in NAMESPACES.items():
                if other != top and name.startswith(prefix) and other not in MAY_USE[top]:
                    problems.append(f"{source.relative_to(root)}: includes {name} of {other}")
            target = next((p for p in (src / name, include / name) if p in owner), None)
            if target is not None and owner[target] != folder and folder:
                needed.setdefault((folder, owner[target]), f"{source.relative_to(root)} includes {name}")
    for (folder, used), why in sorted(needed.items()):
        if used not in allowed.get(folder, []):
            problems.append(f"{why}: {folder} -> {used} is not in the table of {top}/README.md")
    problems += [f"{top}/README.md: {folder} -> {used}, but no include needs it"
                 for folder, uses in allowed.items() for used in uses if (folder, used) not in needed]
    problems += [f"{top}/README.md: the table lacks the folder {folder}" for folder in sorted(set(owner.values()) - {""} - set(allowed))]
    return problems


def main() -> int:
    root = Path(sys.argv[1])
    problems = [problem for top in (sys.argv[2:] or NAMESPACES) for problem in check(root, top)]
    print("\n".join(problems) or "The includes follow the tables.")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
