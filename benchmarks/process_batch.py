"""AMIGO and SIMC over the test batch of Åström and Hägglund: what they keep on the full processes.

Source of the batch: K. J. Åström and T. Hägglund, Advanced PID Control, ISA, 2006. The lists were
recalled and then found identical in a public repository; they hold 133 processes where the book
states 134. The family P8 is recalled as (1 - alpha s)/(s + 1)^3; a public repository has a dead
time in its place. Neither was settled by a primary source.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from types import MappingProxyType

import numpy as np

from benchmarks.section import Section
from loop.chain_margins import full_margins
from loop.controller import PID
from loop.errors import RuleNotApplicable
from loop.half_rule import half_rule
from loop.process import TransferFunction
from tuning.catalogue import RULES

# Rule and structure, and the order of the half-rule model it gets.
COLUMNS: Mapping[str, tuple[str, str, int]] = MappingProxyType(
    {
        "SIMC PI": ("simc", "PI", 1),
        "SIMC PID": ("simc", "PID", 2),
        "AMIGO PI": ("amigo", "PI", 1),
        "AMIGO PID": ("amigo", "PID", 1),
    }
)
P1 = (
    0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.3, 1.5, 2, 4, 6, 8, 10, 20, 50, 100, 200, 500, 1000,
)  # fmt: skip
P2 = (
    0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.3, 1.5, 2, 4, 6, 8, 10, 20, 50, 100, 200, 500,
)  # fmt: skip
P3 = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 2, 5, 10)
TENTHS = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
DELAYS = (0.01, 0.02, 0.05, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)


def _over(*factors: tuple[float, ...], numerator: tuple[float, ...] = (1.0,), theta: float = 0.0
          ) -> TransferFunction:  # fmt: skip
    denominator = reduce(np.polymul, [np.array(factor) for factor in factors])
    return TransferFunction(numerator, tuple(float(c) for c in denominator), theta)


def _lag(T: float) -> tuple[float, ...]:
    return (T, 1.0) if T else (1.0,)


def process_batch() -> Iterator[tuple[str, TransferFunction]]:
    """Go through the batch: the name of the family and the process, times in units of 1 s."""
    yield from (("P1", _over(_lag(T), theta=1.0)) for T in P1)
    yield from (("P2", _over(_lag(T), _lag(T), theta=1.0)) for T in P2)
    yield from (("P3", _over(_lag(1.0), _lag(T), _lag(T))) for T in P3)
    yield from (("P4", _over(*[_lag(1.0)] * n)) for n in range(3, 9))
    yield from (("P5", _over(*(_lag(a**k) for k in range(4)))) for a in TENTHS)
    yield from (("P6", _over((1.0, 0.0), _lag(round(1 - d, 9)), theta=d)) for d in DELAYS)
    yield from (
        ("P7", _over(_lag(T), _lag(round(1 - d, 9)), numerator=(T,), theta=d))
        for T in (1.0, 2.0, 5.0, 10.0)
        for d in DELAYS
    )
    yield from (("P8", _over(*[_lag(1.0)] * 3, numerator=(-a, 1.0))) for a in (*TENTHS, 1.0, 1.1))
    yield from (("P9", _over(_lag(1.0), (T * T, 1.4 * T, 1.0))) for T in (*TENTHS, 1.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What one rule keeps on one process.

    Attributes
    ----------
    family : str
        Family of the process.
    column : str
        Rule and structure.
    refusal : str or None
        Why there are no settings.
    stable : bool
        Whether the loop with the full process is stable.
    Ms : float
        Its largest sensitivity, infinite where it is unstable. [-]
    area : float
        Ti/Kc, the area under the deviation after a load step. [s PV/OP]
    """

    family: str
    column: str
    refusal: str | None = None
    stable: bool = False
    Ms: float = float("inf")
    area: float = float("inf")


def kept_on(family: str, process: TransferFunction) -> list[Kept]:
    """Tune one process by every column and take the margins of the process itself."""
    settings: dict[str, PID] = {}
    found = []
    for column, (rule, structure, order) in COLUMNS.items():
        try:
            model = half_rule(process, order=1 if order == 1 else 2).model
            settings[column] = RULES[rule].structures[structure](model)
        except RuleNotApplicable as reason:
            found.append(Kept(family=family, column=column, refusal=str(reason)))
    margins = full_margins(process, tuple(settings.values()))
    for row, (column, pid) in enumerate(settings.items()):
        found.append(
            Kept(
                family=family,
                column=column,
                stable=bool(margins.stable[row]),
                Ms=float(margins.Ms[row]),
                area=pid.Ti / pid.Kc,
            )
        )
    return found


def run() -> Section:
    """Tune the whole batch and write a row for each family."""
    batch = list(process_batch())
    found = [kept for family, process in batch for kept in kept_on(family, process)]
    families = list(dict.fromkeys(family for family, _ in batch))
    rows = [
        (family, str(sum(name == family for name, _ in batch)), *(
            _cell([k for k in found if (k.family, k.column) == (family, column)])
            for column in COLUMNS
        ))
        for family in families
    ]  # fmt: skip
    rows.append(
        ("all", str(len(batch)), *(_cell([k for k in found if k.column == c]) for c in COLUMNS))
    )
    unstable = [k for k in found if k.refusal is None and not k.stable]
    return Section(
        title="AMIGO and SIMC over a batch of processes",
        how=(
            "Ms on the full process, its dead time exact: least, median and largest of the family. "
            "Each rule gets a low-order model by the half rule and its own default speed; PID "
            "settings run with the N that is part of them. The batch: P1 e^(-s)/(1 + sT), "
            "P2 e^(-s)/(1 + sT)^2, P3 1/((s + 1)(1 + sT)^2), P4 1/(s + 1)^n, "
            "P5 1/((s + 1)(1 + as)(1 + a^2 s)(1 + a^3 s)), P6 e^(-sL)/(s (1 + s(1 - L))), "
            "P7 T e^(-sL)/((1 + sT)(1 + s(1 - L))), P8 (1 - as)/(s + 1)^3, "
            "P9 1/((s + 1)((sT)^2 + 1.4 sT + 1))."
        ),
        columns=("family", "processes", *COLUMNS),
        rows=tuple(rows),
        notes=(
            f"{len(unstable)} loops are unstable.",
            "AMIGO was made for models from a step response; here it gets the half rule's, so that "
            "both rules see the same model. SIMC PID needs a second lag, which P1 has not.",
            "The lists hold 133 processes where the book states 134, and P8 is as recalled.",
        ),
    )


def _cell(kept: list[Kept]) -> str:
    answered = np.array([k.Ms for k in kept if k.refusal is None])
    refused = len(kept) - answered.size
    if not answered.size:
        return "refused"
    said = f"{answered.min():.2f}, {np.median(answered):.2f}, {answered.max():.2f}"
    return f"{said} ({refused} refused)" if refused else said
