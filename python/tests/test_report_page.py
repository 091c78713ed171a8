"""report.html in a browser. Needs Debian's chromium, so it is not among the others: sh tests/python.sh -m browser."""

from __future__ import annotations

import html
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

import signorini

pytestmark = pytest.mark.browser

PRESSURE = 1e6

# The actions of a reader: pointing at the middle, moving the slider to the first load step, requesting the same colours in
# all steps.
READER = """
<script>
addEventListener("load", () => setTimeout(() => {
  const canvas = document.querySelector("canvas"), value = () => document.querySelector(".value").textContent;
  const ticks = () => [...document.querySelectorAll(".strip span")].map((tick) => tick.textContent);
  const point = () => canvas.dispatchEvent(new PointerEvent("pointermove", { clientX: middle[0], clientY: middle[1] }));
  const box = canvas.getBoundingClientRect(), middle = [box.left + box.width / 2, box.top + box.height / 2];
  const found = { still: document.getElementById("still").open, dark: getComputedStyle(document.body).backgroundColor };
  point();
  found.last = [value(), ticks()];
  const slider = document.querySelector("input[type=range]");
  slider.value = 0;
  slider.dispatchEvent(new Event("input"));
  point();
  found.first = [value(), ticks(), slider.getAttribute("aria-valuetext")];
  [...document.querySelectorAll("label")].find((label) => label.textContent.includes("same colours")).querySelector("input").click();
  found.fixed = ticks();
  canvas.dispatchEvent(new PointerEvent("pointerleave"));
  found.away = value();
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter" }));
  found.key = value();
  document.body.innerHTML = "<pre>" + JSON.stringify(found) + "</pre>";
}, 300));
</script>
"""


def chromium(*arguments: str) -> str:
    shared = ["chromium", "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--virtual-time-budget=5000"]
    return subprocess.run([*shared, *arguments], capture_output=True, text=True, check=True, timeout=120).stdout


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A block pressed on a smooth floor, by half of the load, then all: the stress is the pressure, everywhere."""
    model = signorini.Model(signorini.box([1, 1, 1], [3, 3, 3])).material(young=1e11, poisson=0.3)
    model.support("left", symmetry=True).support("front", symmetry=True).traction("top", pressure=PRESSURE)
    model.contact("bottom", obstacle={"half_space": {"point": [0, 0, 0], "normal": [0, 0, 1]}}).steps([0.5, 1])
    directory = tmp_path_factory.mktemp("page")
    model.solve(check=True).write(directory, plots=True)
    return directory / "report.html"


def read(page: Path, *arguments: str) -> Any:
    copy = page.with_name("read.html")
    copy.write_text(page.read_text(encoding="utf-8").replace("</body>", f"{READER}</body>"), encoding="utf-8")
    found = re.search(r"<pre>(.*?)</pre>", chromium(*arguments, "--dump-dom", copy.as_uri()), re.S)
    assert found
    return json.loads(html.unescape(found[1]))


def test_pointer_slider_and_colours(page: Path) -> None:
    found = read(page)
    assert found["still"] is False and found["dark"] == "rgb(255, 255, 255)"
    for (value, *_), stress in ((found["last"], PRESSURE), (found["first"], PRESSURE / 2), ([found["key"]], PRESSURE / 2)):
        name, number, unit = re.fullmatch(r"(.*) (\S+) (\S+)", value).groups()  # type: ignore[union-attr]
        assert (name, unit) == ("von Mises stress", "Pa") and abs(float(number) / stress - 1) < 1e-3
    assert found["first"][2] == "1" and found["away"] == ""
    assert found["fixed"] == found["last"][1] != found["first"][1]


def test_dark(page: Path) -> None:
    assert read(page, "--blink-settings=preferredColorScheme=0")["dark"] == "rgb(24, 26, 28)"


def test_two_pages_of_paper(page: Path, tmp_path: Path) -> None:
    paper = tmp_path / "page.pdf"
    chromium(f"--print-to-pdf={paper}", "--no-pdf-header-footer", page.as_uri())
    assert len(re.findall(rb"/Type\s*/Page\b", paper.read_bytes())) in (1, 2)
