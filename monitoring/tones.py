"""A tone in a part of a signal whose noise is an autoregression: both are fitted together.

Fitted alone, an autoregression takes a part of the tone for noise; fitted beside the tone it does
not, and it says what power noise alone has at the tone's frequency. What it leaves of the signal is
white, and there the tone's frequency and part are looked for anew: in the signal itself a window
with sharp ends is full of what stronger frequencies leak into it.
"""

from dataclasses import dataclass

import numpy as np

from loop.signals import Real

# Cycles that a part holds at least.
FEWEST = 5
# Places at which a part may begin and end: all pairs of them are tried.
MOST_EDGES = 110
# Largest order, in no less than so many samples a coefficient.
ORDER, SAMPLES_A_COEFFICIENT = 12, 12
# Samples around the tone that tell the noise: a local one, in a time that no record makes longer.
MOST_ROWS = 2000
ROUNDS = 2
# Innovations above so many standard deviations count less (Huber's weights): loads and set-point
# moves must not pass for the noise.
HUBER = 3.0
# White noise of this part of the variance is assumed in every signal: lags alone predict a sine
# without noise, and an autoregression of it would leave nothing for the tone to explain.
WHITE = 3e-3
REST = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Tone:
    """A sine in a part of a signal.

    Attributes
    ----------
    f : float
        Frequency. [cycles a sample]
    first, stop : int
        First sample, and one past the last.
    score : float
        Power |sum of x exp(-iwt)|^2/n over the spectrum of the noise; in white noise about
        exponential with mean 1 at a given place. [-]
    likelihood : float
        Logarithm of the likelihood of tone and autoregression over that of the same
        autoregression without a tone, about as large; less where lags explain a part of it. [-]
    """

    f: float
    first: int
    stop: int
    score: float
    likelihood: float


def fit_tone(y: Real, f: float, first: int, stop: int, *, reach: int) -> Tone:
    """Fit a tone beside an autoregression of the signal, and improve its frequency and part.

    y[t] = c + sum of a[k] y[t-k] + tone[t] + e[t], the order of the past by BIC.

    Parameters
    ----------
    y : ndarray, shape (n,)
        Evenly sampled signal without gaps.
    f : float
        Frequency to begin with. [cycles a sample]
    first, stop : int
        Part to begin with.
    reach : int
        The part is looked for within so many samples on either side of its middle. [samples]
    """
    middle = (first + stop) // 2
    half = max(MOST_ROWS // 2, (stop - first) // 2 + reach // 2)
    low = int(np.clip(middle - half, 0, max(y.size - 2 * half, 0)))
    near = y[low : low + 2 * half]
    model = _Model(near - near.mean())
    a, b = max(first - low - model.order, 0), stop - low - model.order
    for _ in range(ROUNDS):
        model.fit(f, a, b)
        f, a, b = part_of(model.white(), f, a, b, reach=reach)
    score, likelihood = model.fit(f, a, b)
    away = low + model.order
    return Tone(f=f, first=a + away, stop=b + away, score=score, likelihood=likelihood)


class _Model:
    """Rows of the regression of a signal on its past and on a tone.

    Columns are the constant, the tone's cosine and sine, lags from 1 on, and the signal itself.
    """

    def __init__(self, y: Real) -> None:
        self.order = min(ORDER, y.size // SAMPLES_A_COEFFICIENT)
        self._columns = np.empty((y.size - self.order, self.order + 4))
        self._columns[:, 0] = 1.0
        past = np.lib.stride_tricks.sliding_window_view(y, self.order + 1)
        self._columns[:, 3:] = past[:, ::-1][:, np.r_[1 : self.order + 1, 0]]
        self._weights = np.ones(y.size - self.order)
        self._past = np.zeros(0)

    def fit(self, f: float, a: int, b: int) -> tuple[float, float]:
        """Fit with a tone in rows a..b - 1, weigh the rows anew; the score and the likelihood."""
        D, w = self._columns, self._weights
        tiny = np.finfo(np.float64).tiny
        D[:, 1:3] = 0.0
        angle = 2 * np.pi * f * np.arange(b - a)
        D[a:b, 1], D[a:b, 2] = np.cos(angle), np.sin(angle)
        M = (D * w[:, None]).T @ D
        scale = np.sqrt(np.diag(M)) + tiny
        M /= np.outer(scale, scale)
        # The rest keeps the rows of a signal that does not move, or of no tone, independent.
        M[np.diag_indices_from(M)] += np.r_[np.full(3, REST), np.full(self.order + 1, WHITE)]
        R = np.linalg.cholesky(M).T
        left = np.cumsum(R[::-1, -1] ** 2)[::-1][3:]
        rows = float(np.sum(w))
        p = int(np.argmin(rows * np.log(left) + np.arange(left.size) * np.log(rows)))
        used, alone = np.r_[0 : 3 + p], np.r_[0, 3 : 3 + p]
        x = np.linalg.solve(R[: 3 + p, : 3 + p], R[: 3 + p, -1]) * scale[-1] / scale[used]
        without = M[-1, -1] - M[-1, alone] @ np.linalg.solve(M[np.ix_(alone, alone)], M[alone, -1])
        likelihood = rows / 2 * float(np.log(without / left[p]))
        self._past = np.r_[x[0], 0.0, 0.0, x[3:]]
        e = D[:, -1] - D[:, : 3 + p] @ x
        variance = left[p] * scale[-1] ** 2 / max(rows - p - 3, 1.0)
        power = float(x[1] ** 2 + x[2] ** 2) / 4 * float(np.sum(w[a:b]))
        size = np.abs(e)
        sd = max(float(np.median(size)) / 0.6745, float(np.sqrt(WHITE / rows)) * scale[-1])
        self._weights = np.minimum(1.0, HUBER * sd / np.maximum(size, tiny))
        return float(power / max(variance, tiny)), likelihood

    def white(self) -> Real:
        """What the autoregression leaves of the signal, the tone among it."""
        D = self._columns
        return (D[:, -1] - D[:, : self._past.size] @ self._past) * self._weights


def part_of(y: Real, f: float, first: int, stop: int, *, reach: int) -> tuple[float, int, int]:
    """Frequency [cycles a sample] and part with the most power |sum of y exp(-iwt)|^2/n.

    Both are improved in turn, from those given.
    """
    middle = (first + stop) // 2
    reach = max(reach, stop - first)
    low, high = max(middle - reach, 0), min(middle + reach, y.size)
    near = y[low:high]
    near = near - near.mean()
    t = np.arange(near.size)
    a, b = first - low, stop - low
    for _ in range(2):
        f = frequency_of(near[a:b], f)
        sums = np.cumsum(np.r_[0.0, near * np.exp(-2j * np.pi * f * t)])
        edges = np.arange(0, near.size + 1, max(round(1 / f), -(-near.size // MOST_EDGES)))
        lengths = edges - edges[:, None]
        found = sums[edges] - sums[edges, None]
        power = (found.real**2 + found.imag**2) / np.maximum(lengths, 1)
        power[lengths < FEWEST / f] = 0.0
        if power.max() > 0:
            i, j = np.unravel_index(int(np.argmax(power)), power.shape)
            a, b = int(edges[i]), int(edges[j])
    return frequency_of(near[a:b], f), low + a, low + b


def frequency_of(part: Real, f: float) -> float:
    """Frequency with the most power within 0.8 cycles a part, by a parabola through the best."""
    t = np.arange(part.size)
    step = 0.2 / part.size
    turned = part * np.exp(-2j * np.pi * (f - 4 * step) * t)
    turn = np.exp(-2j * np.pi * step * t)
    power = np.empty(9)
    for k in range(9):
        power[k] = abs(turned.sum()) ** 2
        turned *= turn
    k = int(np.clip(np.argmax(power), 1, 7))
    left, mid, right = power[k - 1 : k + 2].tolist()
    bend = left - 2 * mid + right
    shift = 0.5 * (left - right) / bend if bend < 0 else 0.0
    return float(f + (k - 4 + np.clip(shift, -1.0, 1.0)) * step)
