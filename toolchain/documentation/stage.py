"""Collects the pages of the documentation site: stage.py REPOSITORY GENERATED STAGE

STAGE receives the Markdown pages and pictures of REPOSITORY at the same relative paths, so that their links hold as they
stand; the pages of `pages/`, which arrange them in four parts; and a page for each man page in GENERATED (*.1, *.5, *.8). A link to
a folder, as a code host shows it, becomes a link to a page that shows the folder's files; a linked file that is no page is
copied beside.
"""

import posixpath
import re
import shutil
import subprocess
import sys
from pathlib import Path

LINK = re.compile(r"(!?\[[^\]\n]*(?:\][^\[\]\n]*)?\]\()([^()\s]+)(\))")
FENCE = re.compile(r"^\s*(```|~~~)")
LANGUAGES = {".c": "c", ".cpp": "cpp", ".h": "c", ".hpp": "cpp", ".py": "python", ".toml": "toml", ".json": "json"}


def files_of(repository: Path) -> list[str]:
    """The paths of all files of the repository, but none that a build made."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, cwd=repository, check=True, capture_output=True, text=True)
    return [path for path in listed.stdout.splitlines() if (repository / path).is_file()]


def folder_page(repository: Path, folder: str, files: list[str]) -> str:
    """A page that lists a folder: links to its pages, the text of its other files."""
    inside = [path for path in files if path.startswith(folder + "/")]
    parts = [f"---\norphan: true\n---\n# {folder}\n"]
    for path in inside:
        name = path[len(folder) + 1 :]
        if path.endswith(".md"):
            parts.append(f"- [{name}]({name})\n")
    for path in inside:
        name = path[len(folder) + 1 :]
        text = (repository / path).read_bytes()
        if path.endswith(".md") or b"\0" in text or len(text) > 20000:
            continue
        language = LANGUAGES.get(Path(path).suffix, "text")
        parts.append(f"## {name}\n\n````{language}\n{text.decode()}\n````\n")
    return "\n".join(parts)


def staged_text(text: str, path: str, repository: Path, linked_folders: set[str], linked_files: set[str]) -> str:
    """The text of a page with links to folders replaced; notes what its links need beside pages."""

    def replacement(match: re.Match[str]) -> str:
        target, _, anchor = match[2].partition("#")
        if re.match(r"[a-z]+:", match[2]) or not target:
            return match[0]
        place = posixpath.normpath(posixpath.join(posixpath.dirname(path), target))
        if (repository / place).is_dir():
            if (repository / place / "README.md").is_file():
                return match[1] + target.rstrip("/") + "/README.md" + match[3]
            linked_folders.add(place)
            return match[1] + target.rstrip("/") + "/index.md" + match[3]
        if (repository / place).is_file() and not target.endswith((".md", ".png")):
            linked_files.add(place)
        return match[0]

    lines, fenced = [], False
    for line in text.split("\n"):
        fenced ^= bool(FENCE.match(line))
        lines.append(line if fenced or line.startswith("    ") else LINK.sub(replacement, line))
    return "\n".join(lines)


def man_page(page: Path) -> str:
    """A man page as HTML within a page of the site."""
    command = ["mandoc", "-T", "html", "-O", "fragment", str(page)]
    html = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    html = re.sub(r'<table class="(head|foot)">.*?</table>', "", html, flags=re.DOTALL)
    name, section = page.name.rsplit(".", 1)
    return f"# {name}({section})\n\n```{{raw}} html\n{html}\n```\n"


def main() -> None:
    repository, generated, stage = map(Path, sys.argv[1:4])
    shutil.rmtree(stage, ignore_errors=True)
    files = files_of(repository)
    pages = {path: repository / path for path in files if path.endswith(".md") and not path.startswith("toolchain/documentation/")}
    arranged = Path(__file__).parent / "pages"
    pages |= {page.name: page for page in arranged.glob("*.md")}

    folders: set[str] = set()
    others = {path for path in files if path.endswith(".png")}
    texts = {path: staged_text(source.read_text(), path, repository, folders, others) for path, source in pages.items()}
    # The arranged pages move from three folders deep to the top.
    texts |= {page.name: texts[page.name].replace("](../../../", "](") for page in arranged.glob("*.md")}
    texts |= {f"{folder}/index.md": folder_page(repository, folder, files) for folder in folders}
    texts |= {f"programs/{page.name}.md": man_page(page) for page in sorted(generated.rglob("*.[158]"))}
    for path, text in texts.items():
        (stage / path).parent.mkdir(parents=True, exist_ok=True)
        (stage / path).write_text(text)
    for path in others:
        (stage / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(repository / path, stage / path)


if __name__ == "__main__":
    main()
