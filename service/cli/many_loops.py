"""The loops of exports, Parquet files and folders of them, one after the other."""

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from historian.errors import ExportRefused
from historian.export import Export
from historian.parquet_loops import loops_in, parquet_files
from loop.record import Record
from service.cli import reading


def files_of(source: Path) -> list[Path]:
    """List a file alone, or the Parquet files of a folder."""
    return parquet_files(source) if source.is_dir() else [source]


def records_in(
    files: Iterable[Path],
    stated: reading.Stated,
    *,
    refused: Callable[[str, str], None] | None = None,
) -> Iterator[Record]:
    """Read the loops of files, one file in memory at a time.

    Parameters
    ----------
    files : iterable of Path
        Exports and Parquet files.
    stated : reading.Stated
        What the user said of their columns.
    refused : callable, optional
        Told of every Parquet file or loop that gives no record, and why, so that it costs the
        others nothing; without it the first such file ends everything.
    """
    for file in files:
        if file.suffix != ".parquet":
            export = reading.read_file(file, stated)
            yield from (export.record(name) for name in _tags(export, stated.tag))
            continue
        codes = stated.options().mode_codes
        try:
            for name, samples in loops_in(file, mode_codes=codes):
                if stated.tag not in (None, name):
                    continue
                if len(samples):
                    yield samples.record(tag=name)
                elif refused is not None:
                    refused(name, f"{file.name} holds no samples of it")
        except ExportRefused as reason:
            if refused is None:
                raise
            refused(file.stem, str(reason))


def _tags(export: Export, wanted: str | None) -> list[str]:
    return [wanted] if wanted is not None else [*export.loops]
