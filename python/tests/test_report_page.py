"""report.html in a browser: Debian's chromium, which tests/python.sh installs."""

from __future__ import annotations

import html
import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

import signorini

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
  const contact = () => document.querySelector("figure[data-of=contact] svg title, figure[data-of=contact] svg text").textContent;
  found.contact = contact();
  found.states = [...document.querySelectorAll(".dot")].map((row) => row.textContent);
  const play = [...document.querySelectorAll("button")].find((button) => button.textContent === "Play");
  play.click();
  found.play = [play.textContent];
  [...document.querySelectorAll("label")].find((label) => label.textContent.includes("same colours")).querySelector("input").click();
  found.fixed = ticks();
  canvas.dispatchEvent(new PointerEvent("pointerleave"));
  found.away = value();
  canvas.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter" }));
  found.key = value();
  setTimeout(() => {
    found.play.push(play.textContent, slider.value, contact());
    document.body.innerHTML = "<pre>" + JSON.stringify(found) + "</pre>";
  }, 1000);
}, 300));
</script>
"""


def chromium(*arguments: str) -> str:
    shared = ["chromium", "--headless", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--virtual-time-budget=5000"]
    return subprocess.run([*shared, *arguments], capture_output=True, text=True, check=True, timeout=120).stdout


@pytest.fixture(scope="module", params=["plane", "space"])
def page(tmp_path_factory: pytest.TempPathFactory, request: pytest.FixtureRequest) -> Path:
    """A block pressed on a smooth floor, by half of the load, then all: the stress is the pressure, everywhere."""
    if request.param == "plane":
        model = signorini.Model(signorini.rectangle([1, 1], [3, 3])).analysis(plane="plane_stress")
        floor: Any = {"half_plane": {"point": [0, 0], "normal": [0, 1]}}
    else:
        model = signorini.Model(signorini.box([1, 1, 1], [3, 3, 3])).support("front", symmetry=True)
        floor = {"half_space": {"point": [0, 0, 0], "normal": [0, 0, 1]}}
    model.material(young=1e11, poisson=0.3).support("left", symmetry=True).traction("top", pressure=PRESSURE)
    model.contact("bottom", obstacle=floor).steps([0.5, 1])
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
    assert found["contact"].endswith("load step 1") and found["states"] in ([], ["in contact", "separated"])
    assert found["play"][:2] == ["Stop", "Play"] and found["play"][2] == "1" and found["play"][3].endswith("load step 2")


def test_dark(page: Path) -> None:
    assert read(page, "--blink-settings=preferredColorScheme=0")["dark"] == "rgb(24, 26, 28)"


def test_two_pages_of_paper(page: Path, tmp_path: Path) -> None:
    paper = tmp_path / "page.pdf"
    chromium(f"--print-to-pdf={paper}", "--no-pdf-header-footer", page.as_uri())
    assert len(re.findall(rb"/Type\s*/Page\b", paper.read_bytes())) in (1, 2)
