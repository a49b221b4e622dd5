"""Decide what cells that are no numbers mean: gaps, modes, or rejected."""

import numpy as np

from historian.accounting import Ledger
from historian.cells import Places, Words
from historian.modes import mode_of
from historian.plan import Plan
from historian.quality import Scheme, is_bad_word, is_good, is_good_word, is_quality_word
from historian.streams import Integers
from loop.record import Mode
from loop.signals import Codes, Flags, Real

NOT_A_NUMBER = "it is no number and no known word for a missing value"
TOO_LARGE = "it is beyond any measurement (infinite or over 3.4e38)"


def account_odd_cells(
    ledger: Ledger, tag: str, rows: Places, words: Words, lines: Integers, used: Flags
) -> None:
    """Count cells that are no numbers: known words are gaps, others are rejected.

    Parameters
    ----------
    ledger : Ledger
        Told of every cell.
    tag : str
        Tag the cells belong to.
    rows, words
        Rows of the block and what stands in them.
    lines, used : ndarray, shape (n,)
        Line of every row of the block, and whether the row is used at all.
    """
    kept = used[rows]
    rows, places = rows[kept], words.places[kept]
    for place in np.unique(places).tolist():
        word, where = words.words[place], rows[places == place]
        if is_bad_word(word) or (is_quality_word(word) and not is_good_word(word)):
            ledger.gap_word(tag, word, where.size)
        else:
            reason = TOO_LARGE if _is_infinite(word) else NOT_A_NUMBER
            ledger.reject_cells(lines[where], tag, word, reason)


def _is_infinite(word: str) -> bool:
    try:
        return abs(float(word.replace(",", "."))) > 1
    except ValueError:
        return False


def blank_bad_quality(
    plan: Plan,
    ledger: Ledger,
    tag: str,
    column: int,
    words: Words,
    values: Real,
    lines: Integers,
    used: Flags,
) -> Real:
    """Turn values of bad or unknown quality into gaps."""
    scheme = plan.schemes.get(column, Scheme.WORDS)
    counted = used & np.isfinite(values)
    bad = np.zeros(values.size, dtype=np.bool_)
    for place, word in enumerate(words.words):
        good = is_good(word, scheme, plan.options.good_quality)
        if good:
            continue
        where = (words.places == place) & counted
        bad |= where
        if not where.any():
            continue
        if good is None:
            reason = "its quality is not known" if word else "no quality is stated"
            ledger.reject_cells(lines[where], tag, word, reason)
        else:
            ledger.gap_word(tag, f"quality {word}", int(np.count_nonzero(where)))
    return np.where(bad, np.nan, values) if bad.any() else values


def modes_of(plan: Plan, ledger: Ledger, words: Words, used: Flags) -> Codes:
    """Read a column of modes as numbers of `Mode`; what nothing explains is UNKNOWN."""
    codes = np.full(len(words.words), Mode.UNKNOWN, dtype=np.int8)
    for place, word in enumerate(words.words):
        mode = mode_of(word, plan.options.mode_codes)
        if mode is not None:
            codes[place] = mode
        elif word and not is_bad_word(word):
            count = int(np.count_nonzero((words.places == place) & used))
            if count:
                ledger.unknown_modes[word] += count
    return codes[words.places]
