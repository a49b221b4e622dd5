"""The details around settings as a JSON document and in words."""

from dataclasses import asdict

from advice.body import Body, margins_body, number, process_body, settings_body
from advice.conditioning import Conditioning, MeasuredNoise
from advice.display import digits, margins_words
from loop.margins import Margins
from tuning.conditioning import PVFilter, ScanCost
from tuning.output_movement import OutputMovement


def conditioning_body(found: Conditioning, measured: MeasuredNoise | None = None) -> Body:
    """The details as the JSON document of command line and API.

    Parameters
    ----------
    found : Conditioning
        What `advice.conditioning` answered.
    measured : MeasuredNoise, optional
        Where the noise comes from, if it was measured.
    """
    return {
        "process": process_body(found.process),
        "controller": settings_body(found.pid),
        "margins": margins_body(found.margins),
        "wc": found.wc,
        "noise": found.wanted.noise,
        "measured_noise": None if measured is None else asdict(measured),
        "longest_scan_time": found.longest,
        "scan_time": found.scan_time,
        "scan": None if found.scan is None else _scan_body(found.scan),
        "pv_filter": None if found.pv_filter is None else _filter_body(found.pv_filter),
        "filter_ratios": [
            {
                "N": row.N,
                "margins": margins_body(row.margins),
                "movement": _movement_body(row.movement),
            }
            for row in found.ratios
        ],
        "set_point_weight": None if found.weight is None else asdict(found.weight),
        "Tt": found.Tt,
        "anti_alias": None if found.anti_alias is None else asdict(found.anti_alias),
        "folded_frequency": found.folded,
        "notes": list(found.notes),
        "sentences": list(conditioning_sentences(found, measured)),
    }


def _scan_body(scan: ScanCost) -> Body:
    return {
        "scan_time": scan.scan_time,
        "computation": scan.computation,
        "phase_cost": scan.phase_cost,
        "margins": margins_body(scan.scanned),
        "scans_a_filter": number(scan.scans_a_filter),
    }


def _filter_body(found: PVFilter) -> Body:
    return {
        "time": found.time,
        "enough": found.enough,
        "phase_cost": found.phase_cost,
        "movement_without": _movement_body(found.before),
        "movement": _movement_body(found.after),
        "margins_without": margins_body(found.without),
        "margins": margins_body(found.within),
    }


def _movement_body(moved: OutputMovement) -> Body:
    return {name: number(value) for name, value in asdict(moved).items()}


def conditioning_sentences(found: Conditioning, measured: MeasuredNoise | None = None) -> list[str]:
    """The details in words.

    Parameters
    ----------
    found : Conditioning
        What `advice.conditioning` answered.
    measured : MeasuredNoise, optional
        Where the noise comes from, if it was measured.
    """
    asked = found.wanted
    sentences = [f"Without a scan: {margins_words(found.margins)}."]
    if found.longest is not None:
        sentences.append(
            f"Scan every {digits(found.longest, 3)} s or faster: that costs "
            f"{asked.phase_cost:.3g}° of phase at the crossover of {digits(found.wc, 3)} rad/s."
        )
    if found.scan is not None:
        sentences.append(
            f"A scan of {digits(found.scan.scan_time, 3)} s with {asked.computation:g} s of "
            f"computation costs {digits(found.scan.phase_cost, 3)}°: {_kept(found.scan.scanned)}."
        )
    if measured is not None:
        grid = "" if measured.resolution is None else f", resolution {measured.resolution:.4g}"
        sentences.append(
            f"Noise measured on {measured.samples} samples: {digits(measured.sd, 3)} PV{grid}."
        )
    if found.pv_filter is not None:
        sentences += _filter_words(found.pv_filter, asked.travel)
    sentences += [
        f"N = {row.N:g}: Ms {digits(row.margins.Ms, 3)}, travel {digits(row.movement.travel, 3)} "
        "OP a day."
        for row in found.ratios
    ]
    if found.weight is not None:
        kept = "" if found.weight.enough else f", more than the {asked.overshoot:g} % allowed"
        sentences.append(
            f"Set-point weight b = {found.weight.b:g}: overshoot "
            f"{digits(found.weight.overshoot, 3)} %{kept}. Keep c = 0: the derivative of PV alone."
        )
    if found.Tt is not None:
        sentences.append(f"Tracking time of back-calculation: Tt = {digits(found.Tt, 3)} s.")
    if found.anti_alias is not None:
        shape = "one lag" if found.anti_alias.order == 1 else "Butterworth, second order"
        sentences.append(
            f"Anti-alias filter ahead of the sampling ({shape}): corner at "
            f"{digits(found.anti_alias.w0, 3)} rad/s, {found.anti_alias.attenuation:g} at half the "
            f"scan rate, {digits(found.anti_alias.phase_cost, 3)}° at the crossover."
        )
    if found.folded is not None and asked.swing is not None:
        sentences.append(
            f"A swing at {asked.swing:g} rad/s appears in the samples at "
            f"{digits(found.folded, 3)} rad/s."
        )
    return sentences + list(found.notes)


def _kept(found: Margins) -> str:
    return f"phase margin {digits(found.phase, 3)}°, Ms {digits(found.Ms, 3)}"


def _filter_words(found: PVFilter, travel: float | None) -> list[str]:
    before, after = found.before, found.after
    sentences = [
        f"Without a filter on PV the noise moves the output by {digits(before.travel, 3)} OP a "
        f"day in {digits(before.reversals, 3)} reversals; sd {digits(before.sd, 3)} OP."
    ]
    if found.time:
        sentences.append(
            f"A filter of {digits(found.time, 3)} s leaves {digits(after.travel, 3)} OP a day and "
            f"costs {digits(found.phase_cost, 3)}°: {_kept(found.within)}, without it "
            f"{_kept(found.without)}."
        )
    else:
        sentences.append("No filter on PV is needed for that travel.")
    if not found.enough and travel is not None:
        sentences.append(
            f"That is not enough for {travel:g} OP a day: the controller must be slower, or the "
            "sensor better."
        )
    return sentences
