"""The pages of the toolbox: their code runs as printed, and they name what they describe."""

import re
from importlib import import_module
from pathlib import Path

import pytest

METHODS = Path(__file__).parents[2] / "docs" / "methods"
PAGES = [
    METHODS / f"{name}.md"
    for name in (
        "classical-toolbox",
        "performance-limits",
        "beyond-one-loop",
        "model-export",
        "smooth",
    )
]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_the_code_of_the_page_runs_and_its_modules_exist(page: Path) -> None:
    text = page.read_text("utf-8")
    found = re.findall(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    assert found
    for block in found:
        exec(compile(block, str(page), "exec"), {})  # noqa: S102 - that is the test
    for module in set(re.findall(r"`((?:loop|tuning|advice)\.[a-z_.]+)`", text)):
        try:
            import_module(module)
        except ModuleNotFoundError:
            owner, _, name = module.rpartition(".")
            assert hasattr(import_module(owner), name), module
