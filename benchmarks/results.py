"""Saved results and the page made from them."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Self

from benchmarks.section import Json, Section, as_markdown

HEAD = """# Benchmarks

Loopwright beside its peers, measured in one run by `make bench` and written by it; do not edit.
`python -m benchmarks --list` names the benchmarks, `python -m benchmarks margins` runs one.

All run on one thread (OMP_NUM_THREADS=1) unless a table says otherwise. The ways to do the same
work take turns, round after round, so that whatever else the machine does hits all alike; work
under 20 ms is warmed up by one call in every round. Times are processor time (on an idle machine
the same as wall time), the median of the rounds with the shortest in brackets; through HTTP they
are wall time. A load above the number of cores says that
other programs ran meanwhile: caches and memory are then shared, and all times are longer. Every
answer is checked, the error is printed beside the time. Where a peer cannot do the same work, it
is given the nearest work that it can do, and a note says what is missing. Differences under 20 %
are noise.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Result:
    """A section with the surroundings that it was measured in."""

    section: Section
    surroundings: Mapping[str, str]

    def to_json(self) -> dict[str, Json]:
        """Turn into what the json module writes."""
        return {"section": self.section.to_json(), "surroundings": dict(self.surroundings)}

    @classmethod
    def from_json(cls, body: Json) -> Self:
        """Read back what `to_json` gave."""
        assert isinstance(body, dict)
        section, facts = body["section"], body["surroundings"]
        assert isinstance(section, dict)
        assert isinstance(facts, dict)
        return cls(
            section=Section.from_json(section),
            surroundings={name: str(value) for name, value in facts.items()},
        )


def load(path: Path) -> dict[str, Result]:
    """Read saved results by the name of their benchmark; none if there is no file yet."""
    if not path.exists():
        return {}
    saved = json.loads(path.read_text(encoding="utf-8"))
    return {name: Result.from_json(body) for name, body in saved.items()}


def save(path: Path, results: Mapping[str, Result]) -> None:
    """Write results for `load`."""
    body = {name: result.to_json() for name, result in results.items()}
    path.write_text(json.dumps(body, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")


def page(results: Mapping[str, Result]) -> str:
    """Write the page of all results, the targets that were missed first."""
    parts = [HEAD, _verdicts(results)]
    for result in results.values():
        parts.append(as_markdown(result.section))
        parts.append(
            f"Measured {result.surroundings['date']} at commit {result.surroundings['commit']}, "
            f"load of the machine {result.surroundings['load before']} before the start.\n"
        )
    parts.append("## Machine and versions\n\n" + "\n".join(_places(results)) + "\n")
    return "\n".join(parts)


def _place(result: Result) -> str:
    facts = result.surroundings
    return f"- {facts['processor']}, {facts['memory']}, {facts['system']}; {facts['versions']}"


def _places(results: Mapping[str, Result]) -> list[str]:
    return list(dict.fromkeys(_place(result) for result in results.values()))


def _verdicts(results: Mapping[str, Result]) -> str:
    sections = [result.section for result in results.values()]
    targets = [(section.title, target) for section in sections for target in section.targets]
    missed = [f"- {title}: {target}" for title, target in targets if not target.met]
    counted = f"{len(targets) - len(missed)} of {len(targets)} targets are met."
    if not missed:
        return f"## Where it falls short\n\n{counted} The notes below the tables name the rest.\n"
    return "\n".join(["## Where it falls short", "", f"{counted} Missed:", "", *missed, ""])
