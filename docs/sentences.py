"""Draws sentences of pages, messages and comments at random, for a reader to judge, and counts stilted constructions:
``python docs/sentences.py [SEED [COUNT]]``."""

import ast
import random
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CONSTRUCTIONS = {
    "stands": r"\bstands?\b",
    "is none, are none": r"\b(is|are) none\b",
    "but for": r"\bbut for\b",
    "cannot be meant": r"\bcannot be meant\b",
    "lies": r"\blies?\b",
    "said of": r"\bsaid of\b",
    "comes to nothing": r"\bcomes? to nothing\b",
    "of which": r"\bof which\b",
    "as far as": r"\bas far as\b",
    "what …": r"\bwhat\b",
}


def page(text: str) -> list[str]:
    text = re.sub(r"^```.*?^```|^( {4}|\||#).*?$", "", text, flags=re.M | re.S)
    return re.split(r"\n\s*\n|\n(?=\s*(?:[-*]|\d+\.) )", text)


def rust(text: str) -> list[str]:
    """Comments, without code in them, and string literals, without markup."""
    comments = re.findall(r"(?:^[ \t]*//[/!]?(?: .*)?\n)+", text, flags=re.M)
    stripped = (re.sub(r"^[ \t]*//[/!]? ?", "", block, flags=re.M) for block in comments)
    code = re.sub(r"^[ \t]*//.*$", "", text, flags=re.M)
    strings = re.findall(r'"((?:[^"\\]|\\.)*)"', code, flags=re.S)
    words = (re.sub(r"\\\n\s*", "", one) for one in strings if "</" not in one and "/>" not in one)
    return [part for block in stripped for part in page(block)] + list(words)


def python(text: str) -> list[str]:
    """Docstrings and other strings, and comments."""
    strings = [node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant) and isinstance(node.value, str)]
    return [part for one in strings for part in re.split(r"\n\s*\n", one)] + re.findall(r"(?<!\S)# (.*)", text)


def sentences(parts: list[str]) -> list[str]:
    joined = (" ".join(part.split()) for part in parts)
    return [one for part in joined for one in re.split(r"(?<=[.?!]) (?=[A-ZÀ-Þ`*\[])", part) if len(one.split()) > 5]


if __name__ == "__main__":
    seed, count = (int(given) for given in (sys.argv[1:] + ["1", "40"][len(sys.argv) - 1 :])[:2])
    kinds = [(page, ["*.md", "docs/**/*.md"]), (rust, ["src/**/*.rs", "python/src/*.rs"]), (python, ["python/signorini/*.py"])]
    parts = {
        path.relative_to(ROOT): read(path.read_text(encoding="utf-8"))
        for read, patterns in kinds
        for path in sorted({path for pattern in patterns for path in ROOT.glob(pattern)})
    }
    everything = [(path, one) for path, of in parts.items() for one in sentences(of)]
    for path, one in random.Random(seed).sample(everything, count):
        print(f"{path}: {one}\n")
    for name, pattern in CONSTRUCTIONS.items():
        print(f"{sum(len(re.findall(pattern, part, re.I)) for of in parts.values() for part in of):6}  {name}")
