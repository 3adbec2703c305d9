"""Checks the links of a built site: check_links.py SITE

Every link within the site leads to a file, and to an element of it if it names one; no page needs anything from another
machine to be shown. Prints each defect; exit status 1 if there is one.
"""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# Attributes whose target a browser fetches to show the page; a link to be followed is none of them.
FETCHED = {("img", "src"), ("script", "src"), ("link", "href"), ("iframe", "src"), ("source", "src")}


class Page(HTMLParser):
    """The links of a page and the names of its elements."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.links: list[tuple[str, str, str]] = []
        self.names: set[str] = set()
        self.feed(path.read_text())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for attribute, value in attrs:
            if value is None:
                continue
            if attribute in ("id", "name"):
                self.names.add(value)
            if attribute in ("href", "src"):
                self.links.append((tag, attribute, value))


def defects_of(site: Path) -> list[str]:
    pages = {path: Page(path) for path in site.rglob("*.html")}
    if not pages:
        return [f"{site} has no page"]
    defects = []
    for path, page in pages.items():
        for tag, attribute, link in page.links:
            where = f"{path.relative_to(site)}: {link}"
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                if (tag, attribute) in FETCHED and parts.scheme != "data":
                    defects.append(f"{where} is fetched from another machine")
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path.resolve()
            if not target.is_file():
                defects.append(f"{where} leads to no file")
            elif parts.fragment and target in pages and unquote(parts.fragment) not in pages[target].names:
                defects.append(f"{where} names no element of that page")
    for style in site.rglob("*.css"):
        for link in re.findall(r"url\([\"']?([^\"')]+)", style.read_text()):
            if not link.startswith("data:") and not (style.parent / urlsplit(link).path).is_file():
                defects.append(f"{style.relative_to(site)}: {link} leads to no file")
    return sorted(set(defects))


def main() -> int:
    defects = defects_of(Path(sys.argv[1]).resolve())
    for defect in defects:
        print(f"error: {defect}", file=sys.stderr)
    return 1 if defects else 0


if __name__ == "__main__":
    sys.exit(main())
