"""The benchmarks on offer, by name."""

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from types import MappingProxyType

from benchmarks.section import Section


@dataclass(frozen=True, slots=True, kw_only=True)
class Benchmark:
    """One benchmark: a module of this package with a function `run`.

    Attributes
    ----------
    name : str
        Name on the command line, and of the module.
    about : str
        What it compares, one line.
    seconds : float
        After this long it is stopped. [s]
    """

    name: str
    about: str
    seconds: float

    def run(self) -> Section:
        """Measure; peers are imported only here."""
        section = import_module(f"benchmarks.{self.name}").run()
        assert isinstance(section, Section)
        return section


BENCHMARKS: Mapping[str, Benchmark] = MappingProxyType(
    {
        name: Benchmark(name=name, about=about, seconds=seconds)
        for name, about, seconds in (
            ("margins", "gain, phase, delay margin, Ms, Mt against python-control", 80.0),
            ("fopdt_fit", "FOPDT fit of a step test against scipy curve_fit and gekko", 50.0),
            ("fopdt_bound", "FOPDT fit of 1,000 tests against the Cramér-Rao bound", 35.0),
            ("fopdt_calibration", "whether the stated errors of the FOPDT fit are true", 40.0),
            ("relay", "models from 600 noisy relay tests, theta/tau .05 to 10", 70.0),
            ("closed_loop_fit", "models from routine data against sippy, scipy, gekko", 65.0),
            ("simulation", "closed loop with limits against simple-pid, python-control", 40.0),
            ("box_proof", "the proven worst case of boxes against 100,000 random plants", 60.0),
            ("robust_choice", "load area at equal guaranteed Ms, every published rule", 60.0),
            ("tuning_request", "all rules with their sweeps for one process", 40.0),
            ("process_batch", "AMIGO and SIMC on 133 processes, margins of the process", 60.0),
            ("csv_import", "historian exports against pandas, pyarrow, polars", 310.0),
            ("sample_store", "a loop's month, a day of all loops, corrections", 90.0),
            ("false_alarms", "oscillation and stiction: 1,000 healthy loops, sticking ones", 170.0),
            ("burst_detection", "waves as large as the noise: how many are found", 75.0),
            ("model_indices", "model mismatch, expected response, achievable variance", 170.0),
            ("who_leads", "where a shared oscillation begins, on simulated plants", 170.0),
            ("who_drives", "Granger against statsmodels, and transfer entropy", 120.0),
            ("tennessee_eastman", "sticking valves of the Tennessee Eastman plant", 120.0),
            ("stiction_windows", "stiction in simulated windows of plant history", 120.0),
            ("loop_day", "monitoring of 86,400 samples against statsmodels/scipy", 90.0),
            ("fleet", "a day of many loops out of the sample store, two processes", 150.0),
            ("http_tuning", "a tuning request through HTTP", 60.0),
            ("upload", "five million rows through HTTP into the sample store", 150.0),
        )
    }
)
