"""Write heater-step.csv, the simulated step test of the tutorial: a heater whose truth is known.

K = 2 degC/%, tau = 120 s, theta = 30 s; measurement noise of 0.1 degC, shown to 0.01 degC.
Run `python docs/tutorial/make_heater_step.py` in the root of the project.
"""

import csv
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from loop.open_loop import process_output
from loop.process import FOPDT

FILE = Path(__file__).with_name("heater-step.csv")
START = datetime(2026, 3, 2, 6, 0, tzinfo=UTC)
SAMPLE_TIME = 2.0  # s
NOISE = 0.1  # degC
HOLD = 900.0  # s, some seven time constants
MOVES = (40.0, 46.0, 40.0, 34.0, 40.0)  # %


def main() -> None:
    """Simulate the test and write it as a historian would."""
    t = np.arange(0.0, HOLD * len(MOVES), SAMPLE_TIME)
    op = np.array(MOVES)[(t // HOLD).astype(int)]
    pv = process_output(FOPDT(K=2.0, tau=120.0, theta=30.0), t, op, pv0=80.0)
    pv += np.random.default_rng(900).normal(0.0, NOISE, t.size)
    with FILE.open("w", encoding="utf-8", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(["Time", *(f"TIC-900.{part}" for part in ("PV", "OP", "SP", "MODE"))])
        for seconds, value, output in zip(t.tolist(), pv.tolist(), op.tolist(), strict=True):
            stamp = (START + timedelta(seconds=seconds)).strftime("%Y-%m-%dT%H:%M:%SZ")
            rows.writerow([stamp, f"{value:.2f}", f"{output:.1f}", "80.00", "MAN"])


if __name__ == "__main__":
    main()
