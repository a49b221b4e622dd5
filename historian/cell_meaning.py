"""Decide what cells that are no numbers mean: gaps, modes, or rejected."""

import numpy as np

from historian.accounting import Ledger
from historian.arrow_views import different
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
    for place in different(places):
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
    scheme: Scheme,
    tags: Words,
    quality: Words,
    values: Real,
    lines: Integers,
    used: Flags,
) -> Real:
    """Turn values of bad or unknown quality into gaps, and account for them by tag."""
    verdicts = [is_good(word, scheme, plan.options.good_quality) for word in quality.words]
    good = np.array([verdict is True for verdict in verdicts])[quality.places]
    bad = np.flatnonzero(~good & used & np.isfinite(values))
    if not bad.size:
        return values
    pairs = tags.places[bad] * len(quality.words) + quality.places[bad]
    for pair in different(pairs):
        tag = tags.words[pair // len(quality.words)]
        word = quality.words[pair % len(quality.words)]
        rows = bad[pairs == pair]
        if verdicts[pair % len(quality.words)] is None:
            reason = "its quality is not known" if word else "no quality is stated"
            ledger.reject_cells(lines[rows], tag, word, reason)
        else:
            ledger.gap_word(tag, f"quality {word}", rows.size)
    values = values.copy()
    values[bad] = np.nan
    return values


def modes_of(plan: Plan, ledger: Ledger, words: Words, used: Flags) -> Codes:
    """Read a column of modes as numbers of `Mode`; what nothing explains is UNKNOWN."""
    codes = np.full(len(words.words), Mode.UNKNOWN, dtype=np.int8)
    for place, word in enumerate(words.words):
        mode = mode_of(word, plan.options.mode_codes)
        if mode is not None:
            codes[place] = mode
        elif word and not is_bad_word(word):
            ledger.unknown_modes[word] += int(np.count_nonzero((words.places == place) & used))
    return codes[words.places]
