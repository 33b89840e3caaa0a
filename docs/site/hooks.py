"""Hooks of mkdocs: the README is the first page, files of the repository that pages link to are part of the site, and
every public package has a page made of its docstrings.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
#: Packages of the command line, of reproductions and of the ground, whose names users do not need
INNER = {"cli", "native", "pages", "published", "moving_target"}
LINK = re.compile(r"(\]\()([^)#\s]+)([^)\s]*\))")


def packages() -> list[str]:
    """Packages and modules whose names are public: the packages that import what they offer."""
    listed = [file.parent for file in (ROOT / "wbc").glob("*/__init__.py") if "from wbc." in file.read_text()]
    names = {folder.name for folder in listed} - INNER | {"tasks", "robots", "shapes", "errors"}
    return ["wbc", *(f"wbc.{name}" for name in sorted(names))]


def on_config(config: Any) -> Any:
    """The last two tabs: a page for each item, and one for each package."""
    items = sorted(path.name for path in (ROOT / "docs" / "tasks").glob("*.md") if path.name != "README.md")
    lists = {"Tasks": ["tasks/README.md", *(f"tasks/{name}" for name in items)]}
    lists["Reference"] = [f"api/{package}.md" for package in packages()]
    config.nav = [{tab: lists.get(tab, pages) for tab, pages in entry.items()} for entry in config.nav]
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the first page, the pages of packages, and files outside docs that pages link to."""
    for package in packages():
        text = f"# {package}\n\n::: {package}\n"
        files.append(File.generated(config, f"api/{package}.md", content=text))
    linked: set[Path] = set()
    for source in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        for _, target, _ in LINK.findall(source.read_text(encoding="utf-8")):
            path = (source.parent / target).resolve()
            if not target.startswith("http") and path.is_file() and not path.is_relative_to(ROOT / "docs"):
                linked.add(path)
    for path in sorted(linked - {ROOT / "README.md"}):
        where = f"repository/{path.relative_to(ROOT)}"
        files.append(File.generated(config, where, abs_src_path=str(path)))
    first = _rewritten((ROOT / "README.md").read_text(encoding="utf-8"), ROOT, "")
    files.append(File.generated(config, "index.md", content=first))
    return files


def on_page_markdown(markdown: str, page: Any, config: Any, files: Files) -> str:
    """Links out of docs lead to the files' copies in the site."""
    source = page.file.src_uri
    if source == "index.md" or source.startswith("api/"):
        return markdown
    return _rewritten(markdown, ROOT / "docs" / posixpath.dirname(source), posixpath.dirname(source))


def _rewritten(text: str, folder: Path, page: str) -> str:
    def place(match: re.Match[str]) -> str:
        target = match[2]
        path = (folder / target).resolve()
        if target.startswith("http") or not path.is_relative_to(ROOT):
            return match[0]
        if path == ROOT / "README.md":
            inside = "index.md"
        elif path.is_relative_to(ROOT / "docs"):
            inside = path.relative_to(ROOT / "docs").as_posix()
            inside += "/README.md" if path.is_dir() else ""
        elif path.is_file():
            inside = f"repository/{path.relative_to(ROOT)}"
        else:
            return match[1] + "#)"
        return match[1] + posixpath.relpath(inside, page or ".") + match[3]

    return LINK.sub(place, text)
