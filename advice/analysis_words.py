"""An analysis in words, for a terminal and for the page of a report."""

from advice.analyse import Analysis
from advice.display import digits, margins_words
from loop.errors import INFINITELY_MANY

MOST_POLES = 8
MOST_CROSSINGS = 3
# Of the crossover: integrals smaller than this are rounding.
ROUNDING = 1e-9


def loop_words(analysis: Analysis) -> list[str]:
    """Stability, margins, bandwidths, encirclements and Bode's integral."""
    found, wide = analysis.margins, analysis.bandwidths
    if found is None:
        count = analysis.unstable
        said = "infinitely many" if count == INFINITELY_MANY else str(count)
        noun = "pole" if count == 1 else "poles"
        sentences = [f"Unstable: {said} {noun} right of the axis."]
    else:
        word = "keeps" if analysis.passes else "does not keep"
        sentences = [
            f"Stable: {margins_words(found)}.",
            f"At the model it {word} the profile {analysis.profile.name}.",
        ]
        if found.gain_reduction:
            sentences.append(
                f"Lost as well when the gain falls below {digits(found.gain_reduction, 3)} of it."
            )
    sentences.append(
        f"Crossover {digits(wide.wc, 3)} rad/s; bandwidth {digits(wide.S, 3)} rad/s (S), "
        f"{digits(wide.T, 3)} rad/s (T)."
    )
    if analysis.nyquist is not None:
        n = analysis.nyquist
        sentences.append(
            f"Nyquist: Z = N + P, {n.closed_loop} = {n.encirclements} + {n.open_loop}."
        )
    if analysis.routh is not None:
        order = analysis.pade_order
        how = "" if order is None else f", the dead time by a Padé approximation of order {order}"
        sentences.append(
            f"Roots right of the axis by Routh's array: {analysis.routh.right}, "
            f"on it: {analysis.routh.axis}{how}."
        )
    if analysis.bode is not None:
        integral, law = (
            value if abs(value) > ROUNDING * (wide.wc or 1.0) else 0.0
            for value in (analysis.bode.integral, analysis.bode.expected)
        )
        sentences.append(f"Bode's integral of ln|S|: {integral:.3g}, by its law {law:.3g} rad/s.")
    return sentences + [item.sentence for item in analysis.stability.cancellations]


def pole_words(analysis: Analysis) -> list[str]:
    """The slowest closed-loop poles, and the gains at which a pair stands on the axis."""
    if analysis.poles is None:
        return []
    shown = analysis.poles.poles[analysis.poles.poles.imag >= 0][:MOST_POLES]
    sentences = []
    for pole in shown:
        if pole.imag:
            damping = -pole.real / abs(pole)
            sentences.append(f"{pole.real:.5g} ± {pole.imag:.5g}j rad/s, damping {damping:.3g}")
        else:
            sentences.append(f"{pole.real:.5g} rad/s")
    if analysis.locus is not None:
        sentences += [
            f"On the axis at {w:.5g} rad/s with {k:.5g} times the gain."
            for k, w in analysis.locus.crossings
            if k > 0
        ][:MOST_CROSSINGS]
    return sentences


def limit_words(analysis: Analysis) -> list[str]:
    """What dead time, right half-plane zeros and unstable poles bound, for any controller."""
    phase = f"{analysis.profile.phase:g}°"
    sentences = [limit.sentence for limit in analysis.limits]
    sentences.append(
        f"With a phase margin of {phase} a PID crosses over at {digits(analysis.fastest, 3)} "
        "rad/s at most."
    )
    return sentences


def task_words(analysis: Analysis) -> list[str]:
    """Whether the task can be done, what stays of the load, and when a PID is not enough."""
    sentences = []
    if analysis.feasibility is not None:
        verdict = "Nothing forbids" if analysis.feasibility.possible else "No PID can have"
        sentences += [f"{verdict} that crossover.", *analysis.feasibility.reasons]
    if analysis.peak is not None:
        sentences.append(analysis.peak.sentence)
    if analysis.window is not None:
        sentences += analysis.window.sentences
    sentences += [item.sentence for item in analysis.disturbances]
    sentences.append(analysis.beyond.sentence)
    for finding in analysis.beyond.findings:
        if finding.sentence not in sentences:
            sentences.append(finding.sentence)
        sentences.append(f"What would help: {'; '.join(finding.helps)}.")
    return sentences
