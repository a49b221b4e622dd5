"""What is known of the data and of the model, as pairs of words for a page or a terminal."""

import numpy as np

from advice.display import digits
from advice.tune import TuningCase
from identification.candidate import Candidate
from identification.identify import Identification
from identification.relay_model import RelayModel
from loop.process import FOPDT, Process
from loop.record import Record
from loop.signals import Real

Facts = list[tuple[str, str]]


def pv_unit(record: Record | None) -> str:
    """Unit of PV for an axis or a number; PV itself where nobody said."""
    return (record.pv_unit if record is not None else "") or "PV"


def op_unit(record: Record | None) -> str:
    """Unit of OP for an axis or a number; OP itself where nobody said."""
    return (record.op_unit if record is not None else "") or "OP"


def gain_unit(record: Record | None) -> str:
    """Unit of a controller gain."""
    return f"{op_unit(record)}/{pv_unit(record)}"


def data_facts(record: Record) -> Facts:
    """Say what the record holds."""
    gaps = int(np.count_nonzero(~(np.isfinite(record.pv) & np.isfinite(record.op))))
    facts = [
        ("samples", f"{len(record)}, {gaps} with a gap" if gaps else f"{len(record)}"),
        ("span", f"{digits(record.span)} s"),
        ("sample time", f"{digits(record.sample_time)} s"),
    ]
    if record.start is not None:
        facts.append(("start", record.start.strftime("%Y-%m-%d %H:%M:%S UTC")))
    for name, signal, unit in (
        ("PV", record.pv, pv_unit(record)),
        ("OP", record.op, op_unit(record)),
    ):
        known = signal[np.isfinite(signal)]
        if known.size:
            low, high = digits(float(known.min())), digits(float(known.max()))
            facts.append((name, f"{low} to {high} {unit}"))
    if record.op_before is not None:
        facts.append(("OP before", f"{digits(record.op_before)} {op_unit(record)}, as stated"))
    return facts


def model_facts(case: TuningCase) -> Facts:
    """Say which process the case rests on, how sure that is, and why."""
    if case.relay is not None:
        modelled = [] if case.process is None else _identified(case.relay.model, case.record)
        return [*_relay_facts(case.relay, gain_unit(case.record)), *modelled]
    if case.model is None:
        if case.process is None:
            return []
        return [*stated_facts(case.process), ("verdict", "stated, not identified")]
    return _identified(case.model, case.record)


def stated_facts(process: Process) -> Facts:
    """Say which process it is, by its parameters."""
    return [
        ("process", type(process).__name__),
        *((name, _parameter(getattr(process, name))) for name in process.__dataclass_fields__),
    ]


def _parameter(value: float | tuple[float, ...]) -> str:
    return ", ".join(map(digits, value)) if isinstance(value, tuple) else digits(value)


def _identified(model: Identification, record: Record | None) -> Facts:
    facts = [("verdict", str(model.verdict))]
    if isinstance(model.process, FOPDT) and model.structure is None:
        facts += _one_lag(model.process, model.standard_errors, record)
    if model.process is not None and model.structure is not None:
        found = model.structure
        facts.append(("process", found.structure.formula))
        for name, unit, value, error in zip(
            found.structure.names,
            found.structure.units,
            found.values.tolist(),
            found.standard_errors.tolist(),
            strict=True,
        ):
            stated = unit.replace("PV", pv_unit(record)).replace("OP", op_unit(record))
            width = digits(1.96 * error, 2)
            facts.append((name, f"{digits(value)} ± {width} {stated} (95 %)".replace(" - (", " (")))
        if model.dead_band is not None:
            band, width = model.dead_band, digits(1.96 * model.dead_band.error, 2)
            stated = f"{digits(band.width, 3)} ± {width} {op_unit(record)} (95 %)"
            facts.append(("dead band", stated))
        if model.choice is not None and model.choice.runner_up is not None:
            facts.append(("runner-up", runner_up(model.choice.runner_up)))
    return facts + [("because", reason) for reason in model.reasons]


def runner_up(other: Candidate) -> str:
    """Another structure with the figures that it lost by."""
    values = ", ".join(
        f"{name} {digits(value, 3)}"
        for name, value in zip(other.structure.names, other.values.tolist(), strict=True)
    )
    missed = (
        f"misses PV by up to {digits(100 * other.part, 2)} % of the answer"
        if other.part
        else "misses PV nowhere beyond the noise"
    )
    return f"{other.structure.name}: {values}; {missed}, criterion {other.bic:+.0f} against one lag"


def _one_lag(p: FOPDT, errors: Real | None, record: Record | None) -> Facts:
    widths = np.zeros(3) if errors is None else 1.96 * errors
    K, tau, theta = (digits(width, 2) for width in widths.tolist())
    unit = f"{pv_unit(record)}/{op_unit(record)}"
    return [
        ("process", "K e^(-theta s)/(tau s + 1)"),
        ("K", f"{digits(p.K)} ± {K} {unit} (95 %)"),
        ("tau", f"{digits(p.tau)} ± {tau} s (95 %)"),
        ("theta", f"{digits(p.theta)} ± {theta} s (95 %)"),
    ]


def _relay_facts(found: RelayModel, unit: str) -> Facts:
    relay, exact = found.relay, found.ultimate
    facts = [
        ("relay test", f"{relay.cycles} settled cycles, {relay.discarded} before them left out")
    ]
    if exact is None:
        low, high = digits(relay.Ku_low, 3), digits(relay.Ku_high, 3)
        return [
            *facts,
            ("Ku", f"{digits(relay.Ku)} {unit} by describing function; truly {low} to {high}"),
            ("Pu", f"{digits(relay.Pu)} s"),
            ("K", "not known" if relay.K is None else f"{digits(relay.K)} (from the relay's bias)"),
            *(("because", reason) for reason in found.model.reasons),
        ]
    Ku, Pu = digits(1.96 * exact.Ku_error, 2), digits(1.96 * exact.Pu_error, 2)
    return [
        *facts,
        (
            "Ku",
            f"{digits(exact.Ku)} ± {Ku} {unit} (95 %) from the model; {digits(relay.Ku)} by "
            f"describing function, off by {100 * (relay.Ku / exact.Ku - 1):+.2g} %",
        ),
        (
            "Pu",
            f"{digits(exact.Pu)} ± {Pu} s (95 %) from the model; cycles of {digits(relay.Pu)} s",
        ),
    ]
