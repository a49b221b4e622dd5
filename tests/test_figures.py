"""Figures of the documentation: every one linked, every one drawn by a script, none out of hand."""

import re
from pathlib import Path

from matplotlib.figure import Figure
from numpy import arange

from docs.figures.catalogue import FIGURES
from docs.figures.style import FOLDER, LARGEST_FILE, WIDTH, data, label, panels, write

DOCS = Path(__file__).parent.parent / "docs"


def test_every_linked_image_exists() -> None:
    for page in DOCS.rglob("*.md"):
        for target in re.findall(r"!\[[^\]]*\]\(([^)]+)\)", page.read_text("utf-8")):
            assert (page.parent / target).is_file(), f"{page.relative_to(DOCS)}: {target}"


def test_scripts_draw_exactly_the_figures_present_and_their_pages_show_them() -> None:
    assert {file.name for file in FOLDER.iterdir()} == {f"{page}.svg" for page in FIGURES}
    for page in FIGURES:
        text = (DOCS / "methods" / f"{page}.md").read_text("utf-8")
        assert f"](../images/methods/{page}.svg)" in text, page


def test_figures_are_small_name_their_axes_and_carry_no_date() -> None:
    for file in FOLDER.glob("*.svg"):
        text = file.read_text("utf-8")
        assert len(text) <= LARGEST_FILE, file.name
        assert f'width="{72 * WIDTH:.0f}pt"' in text, file.name
        assert "<text" in text, file.name
        assert "dc:date" not in text, file.name


def test_drawing_a_figure_again_gives_the_same_bytes(tmp_path: Path) -> None:
    def draw() -> Figure:
        figure, (axes,) = panels()
        data(axes, arange(9.0), arange(9.0) ** 2, "readings")
        label(axes, x="Time [s]", y="PV [°C]")
        return figure

    seen = []
    for _ in range(2):
        write({"page": draw}, tmp_path)
        seen.append((tmp_path / "page.svg").read_bytes())
    assert seen[0] == seen[1]
