"""The code of the pages about monitoring runs."""

import re
from pathlib import Path

import pytest

METHODS = Path(__file__).parents[2] / "docs" / "methods"


@pytest.mark.parametrize(
    "page",
    ["achievable-variance", "diagnosis", "expected-response", "model-mismatch", "plant-wide"],
)
def test_the_code_of_a_page_runs(page: str) -> None:
    text = (METHODS / f"{page}.md").read_text(encoding="utf-8")
    blocks = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        exec(block, names)  # noqa: S102 - the pages are ours, and this is what keeps them true
