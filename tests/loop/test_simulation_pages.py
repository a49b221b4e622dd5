"""The examples on the pages of simulation, virtual plant and conditioning run as printed."""

import re
from pathlib import Path

import pytest

METHODS = Path(__file__).parents[2] / "docs" / "methods"


@pytest.mark.parametrize(
    "page", ["simulation", "valve-models", "virtual-plant", "conditioning", "what-if"]
)
def test_every_python_block_runs(page: str) -> None:
    text = (METHODS / f"{page}.md").read_text("utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert blocks
    for block in blocks:
        exec(compile(block, page, "exec"), {})  # noqa: S102 - that is the test
