"""Read controller modes: obvious words by themselves, codes only by an explicit map."""

from collections.abc import Mapping

from loop.record import Mode

_WORDS: Mapping[str, Mode] = {
    "MAN": Mode.MAN,
    "MANUAL": Mode.MAN,
    "AUTO": Mode.AUTO,
    "AUT": Mode.AUTO,
    "AUTOMATIC": Mode.AUTO,
    "CAS": Mode.CAS,
    "CASC": Mode.CAS,
    "CASCADE": Mode.CAS,
    "REMOTE": Mode.REMOTE,
    "REM": Mode.REMOTE,
    "RCAS": Mode.REMOTE,
    "RSP": Mode.REMOTE,
}


def is_mode_word(text: str) -> bool:
    """Tell whether a cell is an obvious word for a mode."""
    return text.strip().upper() in _WORDS


def mode_of(cell: str, codes: Mapping[int | str, Mode]) -> Mode | None:
    """Read one cell of a mode column, None where nothing says what it means.

    Parameters
    ----------
    cell : str
        The cell: a word, or a code such as "1" or "1.0".
    codes : mapping
        Meaning of codes and words as the user states it; it goes before the obvious words.
    """
    text = cell.strip()
    stated = codes.get(text)
    if stated is not None:
        return stated
    try:
        number = float(text.replace(",", "."))
    except ValueError:
        return _WORDS.get(text.upper())
    if not number.is_integer():
        return None
    code = int(number)
    return codes.get(code, codes.get(str(code)))
