"""Indices that rest on a process model: false alarms, power, and variance against simulation.

    python -m benchmarks model_indices

Loops are drawn at random: theta/tau 0.1 to 3, gains of both signs and two decades, SIMC settings
of tau_c 1 to 3 theta, ten set-point moves, measurement noise of 5 % of a move and loads that
wander by 20 % of what a move asks of OP.
"""

from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from time import process_time

import numpy as np

from benchmarks.section import Section, Target
from loop.controller import PID, Action
from loop.disturbances import coloured_noise
from loop.errors import LoopDiverged
from loop.process import FOPDT
from loop.process_variation import varied
from loop.signals import Real
from loop.simulation import simulate
from monitoring.achievable_variance import achievable_variance
from monitoring.expected_response import expected_response
from monitoring.known_loop import KnownLoop
from monitoring.loop_signals import Stretch
from monitoring.model_mismatch import ModelVerdict, model_mismatch
from monitoring.set_point_moves import set_point_moves

SEED = 700
WRONG = (("gain", "K"), ("lag", "lag"), ("dead time", "theta"))
DAY = 86_400


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """One random loop, its sheet, and what disturbed it.

    Attributes
    ----------
    stretch : Stretch
        Its record.
    known : KnownLoop
        Its sheet.
    sp, load, noise : ndarray, shape (n,)
        What was done to it. [PV], [OP], [PV]
    """

    stretch: Stretch
    known: KnownLoop
    sp: Real
    load: Real
    noise: Real


def drawn(
    seed: int, factors: dict[str, float], *, size: float = 1.0, n: int | None = None
) -> Drawn | None:
    """Draw a loop whose process is off its sheet by factors; None where that is unstable."""
    rng = np.random.default_rng([SEED, seed])
    theta = float(5 * 10 ** rng.uniform(-0.5, 0.8))
    tau = float(theta * 10 ** rng.uniform(-0.5, 1))
    K = float(rng.choice([-1, 1]) * 10 ** rng.uniform(-1, 1))
    tau_c = theta * float(rng.uniform(1, 3))
    model = FOPDT(K=K, tau=tau, theta=theta)
    pid = PID(
        Kc=tau / abs(K) / (tau_c + theta), Ti=min(tau, 4 * (tau_c + theta)),
        action=Action.for_gain(K),
    )  # fmt: skip
    hold = int(10 * (tau + theta))
    t = np.arange(float(n or 11 * hold))
    sp = 50 + size * ((t // hold) % 2)
    memory = float(10 ** rng.uniform(-0.3, 1)) * (tau + theta)
    load = coloured_noise(t, memory=memory, size=0.2 / abs(K), rng=rng)
    noise = rng.normal(0.0, 0.05, t.size)
    try:
        run = simulate(
            varied(model, **factors), pid, t_end=t[-1], dt=1.0, sp=sp, pv0=50.0, op0=50.0,
            load=load, noise=noise,
        )  # fmt: skip
    except LoopDiverged:
        return None
    if np.ptp(run.pv) > 20 * (size + 1):
        return None
    stretch = Stretch(first=0, dt=1.0, pv=run.pv, op=run.op, sp=run.sp, share=1.0)
    known = KnownLoop(process=model, controller=pid, scan_time=1.0)
    return Drawn(
        stretch=stretch, known=known, sp=sp, load=load,
        noise=noise,
    )  # fmt: skip


def mismatch_words(seed: int, factors: dict[str, float], size: float) -> tuple[str, str, float]:
    """Verdict, suspect and p-value of one loop."""
    one = drawn(seed, factors, size=size)
    if one is None:
        return "unstable", "", 1.0
    found = model_mismatch(one.stretch, one.known)
    return found.verdict.value, found.suspect or "", 1.0 if found.p_value is None else found.p_value


def response_words(seed: int, factors: dict[str, float]) -> bool | None:
    """Whether the responses of one loop went as expected."""
    one = drawn(seed, factors)
    if one is None:
        return None
    return expected_response(one.stretch, set_point_moves(one.stretch), one.known).as_expected


def variance_ratio(seed: int) -> float | None:
    """Achievable variance over that of the loop simulated with those settings."""
    one = drawn(seed, {})
    if one is None:
        return None
    found = achievable_variance(one.stretch, one.known)
    if found.achievable is None or found.Kc is None or found.Ti is None:
        return None
    assert one.known.controller is not None
    best = PID(Kc=found.Kc, Ti=found.Ti, action=one.known.controller.action)
    run = simulate(
        one.known.process, best, t_end=float(one.sp.size - 1), dt=1.0, sp=one.sp, pv0=50.0,
        op0=50.0, load=one.load, noise=one.noise,
    )  # fmt: skip
    return found.achievable / float(np.var(run.sp - run.pv))


def loop_day_ms() -> float:
    """Processor time of all model indices for a loop-day of 86,400 samples. [ms]"""
    one = drawn(3, {}, n=DAY)
    assert one is not None
    best = np.inf
    for _ in range(3):
        begun = process_time()
        moves = set_point_moves(one.stretch)
        for derivative in (False, True):
            achievable_variance(one.stretch, one.known, derivative=derivative)
        model_mismatch(one.stretch, one.known)
        expected_response(one.stretch, moves, one.known)
        best = min(best, process_time() - begun)
    return 1000 * best


def measure(*, right: int = 300, wrong: int = 40, variances: int = 30) -> Section:
    """Ask loops with the right model, and with each parameter off by half."""
    rows, targets = [], []
    with ProcessPoolExecutor(2) as pool:
        said = list(pool.map(partial(mismatch_words, factors={}, size=1.0), range(right)))
        rows.append(_row("right model", said))
        alarms = 100 * float(np.mean([word == ModelVerdict.DOES_NOT for word, _, _ in said]))
        targets.append(
            Target(what="right models called wrong", limit=5.0, unit="%", reached=alarms)
        )
        p = np.array([value for _, _, value in said])
        for size in (1.0, 2.0):
            for name, factor in ((name, f) for name in WRONG for f in (0.5, 1.5)):
                ask = partial(mismatch_words, factors={name[1]: factor}, size=size)
                found = list(pool.map(ask, range(wrong)))
                rows.append(_row(f"{name[0]} x {factor:g}, moves x {size:g}", found))
        fine = [one for one in pool.map(partial(response_words, factors={}), range(wrong)) if one
                is not None]  # fmt: skip
        slow = [one for one in pool.map(partial(response_words, factors={"K": 0.5}), range(wrong))
                if one is not None]  # fmt: skip
        ratios = [one for one in pool.map(variance_ratio, range(variances)) if one is not None]
    targets.append(
        Target(what="right sheets whose responses are called unexpected", limit=5.0, unit="%",
               reached=100 * (1 - float(np.mean(fine))))
    )  # fmt: skip
    off = np.abs(np.log(ratios))
    return Section(
        title="Indices by a process model: false alarms, power, variance",
        how=__doc__.split("\n\n")[2].replace("\n", " ").strip() if __doc__ else "",
        columns=("true process", "loops", "does not agree", "agrees", "undecided", "named rightly"),
        rows=tuple(rows),
        targets=tuple(targets),
        notes=(
            f"p-values of {right} right models: {100 * np.mean(p < 0.01):.1f} % below .01, "
            f"{100 * np.mean(p < 0.05):.1f} % below .05, {100 * np.mean(p < 0.1):.1f} % below .1.",
            f"Half the gain: {100 * (1 - np.mean(slow)):.0f} % of {len(slow)} loops answer their "
            "set point otherwise than expected.",
            f"Achievable variance over that of the loop simulated with the PI found, "
            f"{len(ratios)} loops: median {np.median(ratios):.3f}, 90 % within "
            f"{100 * (np.exp(np.quantile(off, 0.9)) - 1):.1f} %.",
            f"All model indices of a loop-day of 86,400 samples: {loop_day_ms():.0f} ms of one "
            "core.",
        ),
    )


def _row(name: str, said: list[tuple[str, str, float]]) -> tuple[str, ...]:
    stable = [(word, suspect) for word, suspect, _ in said if word != "unstable"]
    words = Counter(word for word, _ in stable)
    right = sum(suspect == name.split(" x ")[0] for _, suspect in stable)
    shares = [f"{100 * words[word] / len(stable):.1f} %" for word in
              (ModelVerdict.DOES_NOT, ModelVerdict.AGREES, ModelVerdict.UNDECIDED)]  # fmt: skip
    named = "-" if name == "right model" else f"{100 * right / len(stable):.0f} %"
    return (name, str(len(stable)), *shares, named)


def run() -> Section:
    """Measure with the numbers of loops that the page speaks of."""
    return measure()
