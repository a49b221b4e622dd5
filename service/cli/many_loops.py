"""The loops of exports, Parquet files and folders of them, one after the other."""

from collections.abc import Iterable, Iterator
from pathlib import Path

from historian.export import Export
from historian.parquet_loops import loops_in, parquet_files
from loop.record import Record
from service.cli import reading


def files_of(source: Path) -> list[Path]:
    """List a file alone, or the Parquet files of a folder."""
    return parquet_files(source) if source.is_dir() else [source]


def records_in(files: Iterable[Path], stated: reading.Stated) -> Iterator[Record]:
    """Read the loops of files, one file in memory at a time."""
    for file in files:
        if file.suffix != ".parquet":
            export = reading.read_file(file, stated)
            yield from (export.record(name) for name in _tags(export, stated.tag))
            continue
        codes = stated.options().mode_codes
        for name, samples in loops_in(file, mode_codes=codes):
            if len(samples) and stated.tag in (None, name):
                yield samples.record(tag=name)


def _tags(export: Export, wanted: str | None) -> list[str]:
    return [wanted] if wanted is not None else [*export.loops]
