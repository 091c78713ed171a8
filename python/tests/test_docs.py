"""The documentation: links lead somewhere, tutorials run as they are printed and give the numbers that they show.

Blocks of a page are marked behind their language:

- ``toml,file=NAME`` (any language): what the reader saves as NAME,
- ``sh,run``, ``python,run``: what the reader runs, in the same directory; ``exit=3`` where the program ends with that code,
- ``text,output``: lines of what the block above prints, in this order. ``…`` matches any text; numbers agree to 1e-4, or to what
  ``output=0.02`` says where they depend on the version of a mesher.
"""

from __future__ import annotations

import html
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from conftest import EXAMPLES, ROOT

DOCS = ROOT / "docs"
PAGES = sorted({*DOCS.rglob("*.md"), *ROOT.glob("*.md"), *(ROOT / "python").glob("*.md")})
FENCE = re.compile(r"^```(\S*)\n(.*?)^```$", re.M | re.S)


def blocks(page: Path) -> Iterator[tuple[str, dict[str, str], str]]:
    """Language, marks and text of each block of a page."""
    for info, text in FENCE.findall(page.read_text(encoding="utf-8")):
        language, *marks = info.split(",")
        yield language, {key: value for key, _, value in (mark.partition("=") for mark in marks)}, text


RUN = [page for page in PAGES if any(marks for _, marks, _ in blocks(page))]


def same(shown: str, printed: str, accuracy: float = 1e-4) -> bool:
    """Whether a line is printed as it is shown; the last digits of numbers are those of the machine."""
    number = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
    words = "(.*)".join(re.escape(part) for part in number.sub("\0", shown.strip()).split("…")).replace("\0", f"({number.pattern})")
    found = re.fullmatch(words.replace("(.*)", ".*"), printed.strip())
    return found is not None and all(abs(float(a) - float(b)) <= accuracy * abs(float(a)) for a, b in zip(number.findall(shown), found.groups(), strict=True))


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_pages_run(page: Path, tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES, tmp_path / "examples", ignore=shutil.ignore_patterns("*-out"))
    programs = os.pathsep.join([str(Path(sys.executable).parent), os.environ["PATH"]])
    environment = {**os.environ, "PATH": programs, "MPLBACKEND": "Agg"}
    said, before = "", ""
    for language, marks, text in blocks(page):
        unknown = marks.keys() - {"file", "run", "exit", "output"}
        assert not unknown, f"{page}: {unknown}"
        if "file" in marks:
            (tmp_path / marks["file"]).write_text(text, encoding="utf-8")
        if "run" in marks and language == "python":
            # As in one session: results of earlier blocks exist, and have been printed.
            before, text = before + text, f"{before}\nprint('\\0', end='', flush=True)\n{text}"
        if "run" in marks:
            command = ["sh", "-e", "-c", text] if language == "sh" else [sys.executable, "-c", text]
            run = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True)
            assert run.returncode == int(marks.get("exit", "0")), f"{page}:\n{text}\n{run.stdout}{run.stderr}"
            said = run.stdout.rpartition("\0")[2] + run.stderr
        if "output" in marks:
            printed, accuracy = iter(said.splitlines()), float(marks["output"] or 1e-4)
            for line in filter(str.strip, text.splitlines()):
                assert any(same(line, one, accuracy) for one in printed), f"{page}: not printed, or not in this order:\n{line}\n---\n{said}"


def test_lines_that_differ_are_seen() -> None:
    assert same("p 1.2103e9 of … nodes", "  p 1.210301e9 of 17 nodes")
    assert not same("p 1.2103e9", "p 1.2203e9")
    assert not same("3 stick", "2 stick")
    assert not same("converged", "stagnated")


def test_each_tutorial_runs() -> None:
    for folder in ("learn", "how-to"):
        for page in (DOCS / folder).glob("*.md"):
            assert any("run" in marks for _, marks, _ in blocks(page)), page
            assert any("output" in marks for _, marks, _ in blocks(page)), page


def anchors(page: Path) -> set[str]:
    """The anchors of the page: headings as GitHub and mdBook name them, and anchors that the page defines."""
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    found = set(re.findall(r'<a id="([^"]+)">', text))
    for heading in re.findall(r"^#+ +(.+)$", text, re.M):
        plain = re.sub(r"<[^>]+>|\[([^\]]*)\]\([^)]*\)", r"\1", heading).strip()
        found.add(re.sub(r"[^\w\- ]", "", html.unescape(plain).lower()).replace(" ", "-"))
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links(page: Path) -> None:
    text = FENCE.sub("", page.read_text(encoding="utf-8"))
    links = re.findall(r"\]\(([^)\s]+)\)", text) + re.findall(r'(?:href|src)="([^"]+)"', text)
    for link in links:
        if re.match(r"[a-z]+:", link):
            continue
        # Made by docs/build.sh for the site.
        if live := re.search(r"(?:^|/)live/(\w+)/report\.html$", link):
            assert (EXAMPLES / f"{live[1]}.toml").exists() and live[1] in (DOCS / "build.sh").read_text(encoding="utf-8")
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), f"{page}: {link}"
        assert not anchor or anchor in anchors(target), f"{page}: {link}: no such heading"


def test_the_site_has_every_page() -> None:
    listed = set(re.findall(r"\]\(([^)]+\.md)\)", (DOCS / "SUMMARY.md").read_text(encoding="utf-8")))
    there = {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")} - {"SUMMARY.md"}
    assert listed == there
