"""Draws sentences of the documentation at random, to be judged by a reader: ``python docs/sentences.py [SEED [COUNT]]``."""

import random
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def sentences(page: Path) -> list[str]:
    text = re.sub(r"^```.*?^```$|^( {4}|\||#).*?$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    paragraphs = (" ".join(part.split()) for part in re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", text))
    return [one for part in paragraphs for one in re.split(r"(?<=[.?!]) (?=[A-ZÀ-Þ`*\[])", part) if len(one.split()) > 5]


if __name__ == "__main__":
    seed, count = (int(given) for given in (sys.argv[1:] + ["1", "40"][len(sys.argv) - 1 :])[:2])
    pages = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")})
    drawn = random.Random(seed).sample([(page, one) for page in pages for one in sentences(page)], count)
    for page, one in drawn:
        print(f"{page.relative_to(ROOT)}: {one}\n")
