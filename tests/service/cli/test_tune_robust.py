"""`loopwright tune --proof --optimal`: the same in words, as JSON and on the page."""

import json
from collections.abc import Callable
from pathlib import Path

from service.cli import run

Said = Callable[[], tuple[str, str]]
HEATER = Path(__file__).parents[3] / "docs" / "tutorial" / "heater-step.csv"


def test_proofs_and_optima_are_printed_and_stand_on_the_page(said: Said, tmp_path: Path) -> None:
    page = tmp_path / "heater.html"
    assert run(["tune", str(HEATER), "--proof", "--optimal", "--report", str(page)]) == 0
    text = said()[0]
    for words in ("\nProof\n", "no worse than", "\nOptimal settings\n", "from calm to fast"):
        assert words in text
    html = page.read_text("utf-8")
    assert "<h2>Proof</h2>" in html
    assert "<h2>Optimal settings</h2>" in html


def test_the_document_holds_what_was_asked_for(said: Said) -> None:
    assert run(["tune", str(HEATER), "--proof", "--json"]) == 0
    body = json.loads(said()[0])
    assert body["proof"]["settings"][0]["finished"] is True
    assert "optimal" not in body
