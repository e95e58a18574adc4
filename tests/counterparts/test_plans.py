"""What programs that draw plans put into SVG files, as docs/counterparts.md says."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path

import pytest

from sleepcast.simulator.world.drawing import read_drawing


@pytest.fixture
def plan(tmp_path: Path) -> Path:
    """A PDF with one wall and a name on a page of 8 by 6 inches."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    figure = pyplot.figure(figsize=(8.0, 6.0))
    try:
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0.0, 8.0), ylim=(0.0, 6.0))
        axes.plot([4.0, 4.0], [0.0, 4.0])
        axes.text(1.0, 1.0, "Kitchen")
        axes.axis("off")
        figure.savefig(tmp_path / "plan.pdf")
        figure.savefig(tmp_path / "plan.svg")
    finally:
        pyplot.close(figure)
    return tmp_path / "plan.pdf"


def first_shape(file: Path) -> str:
    """The first of its shapes that is no definition."""
    text = re.sub(r"(?s)<(defs|clipPath)\b.*?</\1>", "", file.read_text(encoding="utf-8"))
    found = re.search(r"<(?:path|rect|circle|line|polyline|polygon)\b[^>]*>", text)
    assert found is not None
    return found[0]


@pytest.mark.counterpart("matplotlib")
def test_matplotlib_draws_a_background(plan: Path) -> None:
    assert "fill: #ffffff" in first_shape(plan.with_suffix(".svg"))
    assert "M 0 432 \nL 576 432 \nL 576 0 \nL 0 0 \nz" in first_shape(plan.with_suffix(".svg"))


@pytest.mark.counterpart("matplotlib", "pdftocairo")
def test_pdftocairo_draws_a_background_and_each_letter_as_a_copy(plan: Path, tmp_path: Path) -> None:
    found = tmp_path / "cairo.svg"
    subprocess.run(["pdftocairo", "-svg", plan, found], check=True)
    assert re.search(r"fill[:=]\"?rgb\(100%, ?100%, ?100%\)", first_shape(found))
    assert len(re.findall(r'<use xlink:href="#glyph', found.read_text(encoding="utf-8"))) == len("Kitchen")
    assert len(read_drawing(found, 72.0).shapes) == 1


@pytest.mark.counterpart("matplotlib", "inkscape", alone=True)
def test_inkscape_keeps_the_background_of_a_pdf(plan: Path, tmp_path: Path) -> None:
    found = tmp_path / "inkscape.svg"
    home = {**os.environ, "HOME": str(tmp_path)}
    subprocess.run(["inkscape", plan, f"--export-filename={found}"], check=True, env=home, capture_output=True)
    assert "fill:#ffffff" in first_shape(found)
    assert len(read_drawing(found, 96.0).shapes) == 1


DRAWING = """<?xml version="1.0" encoding="UTF-8"?>
<office:document xmlns:office="urn:oasis:names:tc:opendocument:xmlns:office:1.0"
 xmlns:draw="urn:oasis:names:tc:opendocument:xmlns:drawing:1.0"
 xmlns:svg="urn:oasis:names:tc:opendocument:xmlns:svg-compatible:1.0"
 office:version="1.3" office:mimetype="application/vnd.oasis.opendocument.graphics">
 <office:body><office:drawing><draw:page>
  <draw:line svg:x1="2cm" svg:y1="2cm" svg:x2="6cm" svg:y2="4cm"/>
 </draw:page></office:drawing></office:body>
</office:document>
"""


@pytest.mark.counterpart("libreoffice", alone=True)
def test_libreoffice_puts_a_box_around_each_shape_that_is_not_drawn(tmp_path: Path) -> None:
    (tmp_path / "plan.fodg").write_text(DRAWING, encoding="utf-8")
    command = ("libreoffice", f"-env:UserInstallation=file://{tmp_path}/home", "--headless", "--convert-to", "svg")
    subprocess.run([*command, "--outdir", tmp_path, tmp_path / "plan.fodg"], check=True, capture_output=True)
    text = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert re.search(r'<rect class="BoundingBox" stroke="none" fill="none"', text)
    assert len(read_drawing(tmp_path / "plan.svg", 100.0).shapes) == 1
