"""An export written and read in one go."""

from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

import pytest

from historian.csv_file import read_export
from historian.export import Export
from historian.options import ReadOptions

Read: TypeAlias = Callable[..., Export]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    def reader(text: str, name: str = "export.csv", **options: object) -> Export:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8", newline="")
        return read_export(path, options=ReadOptions(**options))

    return reader
