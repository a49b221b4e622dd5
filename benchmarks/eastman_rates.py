"""How often the sticking valves of the Tennessee Eastman plant are named, over many runs.

    python -m benchmarks.eastman_rates --first 11 --count 10

prints for IDV 14, 15 and 19 the rate with its 95 % interval, and every run that is not named right.
Nothing of the product was chosen on this plant.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor

from scipy.stats import beta

from benchmarks.eastman_plant import STICKING
from benchmarks.tennessee_eastman import Found, look, named_loops, said_of

CONFIDENCE = 0.95


def interval(hits: int, count: int) -> tuple[float, float]:
    """Clopper and Pearson's interval of a rate, 95 %.

    Parameters
    ----------
    hits, count : int
        Successes, and runs.
    """
    rest = (1 - CONFIDENCE) / 2
    low = float(beta.ppf(rest, hits, count - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1 - rest, hits + 1, count - hits)) if hits < count else 1.0
    return low, high


def words(fault: int, runs: Sequence[Found], seeds: Sequence[int]) -> list[str]:
    """Say how often valves were named, rightly and wrongly, and list the other runs.

    Parameters
    ----------
    fault : int
        Number of the disturbance.
    runs : sequence of Found
        What was said of each.
    seeds : sequence of int
        Their seeds.
    """
    truth = {*STICKING[fault]}
    named = [{*named_loops(one)} for one in runs]
    right = sum(bool(one) and one <= truth for one in named)
    wrong = sum(bool(one - truth) for one in named)
    single = sum(bool({*one.sticking} & truth) for one in runs)
    falsely = sum(bool({*one.sticking} - truth) for one in runs)
    low, high = interval(right, len(runs))
    said = [
        f"IDV {fault} ({', '.join(STICKING[fault])}): of {len(runs)} runs named in {right} "
        f"({100 * low:.0f} to {100 * high:.0f} %), another loop named in {wrong}; by the "
        f"assessment of single loops the valve in {single}, another in {falsely}"
    ]
    for seed, one, loops in zip(seeds, runs, named, strict=True):
        if one.groups and not (loops and loops <= truth):
            groups = "; ".join(said_of(group, one.truth) for group in one.groups)
            said.append(f"  seed {seed}: {groups}")
    return said


def main() -> None:
    """Run the plant and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=11, help="first seed")
    parser.add_argument("--count", type=int, default=10, help="seeds of each disturbance")
    given = parser.parse_args()
    seeds = range(given.first, given.first + given.count)
    with ProcessPoolExecutor(2) as pool:
        for fault in STICKING:
            runs = list(pool.map(_look, [(fault, seed) for seed in seeds]))
            print("\n".join(words(fault, runs, seeds)), flush=True)


def _look(run: tuple[int, int]) -> Found:
    return look(run[0], seed=run[1])


if __name__ == "__main__":
    main()
