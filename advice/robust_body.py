"""Proofs and optimal settings as JSON and in sentences, for every edge that shows a case."""

import math
from collections.abc import Mapping, Sequence

from advice.body import Body, Json, margins_body, number, process_body, settings_body
from advice.robust_choice import CaseProof, OptimalChoice, ProvenSettings
from loop.controller import PID
from tuning.box_proof import BoxProof, WorstCase
from tuning.optimal_search import OptimalSettings

UNITS = {"gain": "", "phase": "°", "delay": " s", "Ms": "", "Mt": ""}
TITLES = {
    "gain": "gain margin", "phase": "phase margin", "delay": "delay margin", "Ms": "Ms", "Mt": "Mt",
}  # fmt: skip


def proof_body(proof: CaseProof) -> Body:
    """Proofs of a case.

    Parameters
    ----------
    proof : CaseProof
        What `advice.robust_choice.prove_case` answered.
    """
    joint = proof.joint_tau_c
    return {
        "settings": [_proven_body(proven) for proven in proof.settings],
        "joint_tau_c": None
        if joint is None
        else {
            "rule": "simc",
            "tau_c": joint.tau_c,
            "one_at_a_time": joint.alone,
            **settings_body(joint.pid),
        },
        "joint_refusal": proof.joint_refusal or None,
    }


def _proven_body(proven: ProvenSettings) -> Body:
    proof, largest = proven.proof, proven.largest
    plant = proof.unstable_plant
    return {
        "name": proven.name,
        **settings_body(proven.pid),
        "errors": dict(proof.errors),
        "stable": proof.stable,
        "worst": _worst_body(proof.worst),
        "unstable_plant": None if plant is None else process_body(plant),
        "finished": proof.finished,
        "cells": proof.cells,
        "certificate": proof.certificate,
        "largest_box": {
            "holds": largest.holds,
            "fails": largest.fails,
            "plant": None if largest.plant is None else process_body(largest.plant),
            "verdict": largest.sentence,
        },
    }


def _worst_body(worst: Mapping[str, WorstCase]) -> Body:
    return {
        name: {
            "found": number(case.found),
            "bound": number(case.bound),
            "plant": process_body(case.plant),
        }
        for name, case in worst.items()
    }


def optimal_body(choices: Sequence[OptimalChoice]) -> Json:
    """Optimal settings of a case.

    Parameters
    ----------
    choices : sequence of OptimalChoice
        What `advice.robust_choice.optimal_choices` answered.
    """
    return [_choice_body(choice) for choice in choices]


def _choice_body(choice: OptimalChoice) -> Body:
    box, draws, curve = choice.over_box, choice.over_draws, choice.front
    return {
        "structure": choice.structure,
        "over_box": None
        if box is None
        else {
            **optimum_body(box.settings),
            "errors": dict(box.errors),
            "proven": box.verdict.holds,
            "verdict": box.verdict.sentence,
        },
        "over_draws": None
        if draws is None
        else {
            **optimum_body(draws.settings),
            "draws": draws.draws,
            "missed": draws.missed,
            "probability": draws.probability,
            "probability_at_least": draws.at_least,
        },
        "front": None
        if curve is None
        else [
            {"knob": knob, **optimum_body(point)}
            for knob, point in zip(curve.knob, curve.points, strict=True)
        ],
        "refusals": list(choice.refusals),
    }


def optimum_body(found: OptimalSettings) -> Body:
    """Settings of least area, with areas and margins at the model."""
    return {
        **settings_body(found.pid),
        "load_IAE": found.load_IAE,
        "load_IE": found.load_IE,
        "output_IAE": found.output_IAE,
        "margins": margins_body(found.margins),
    }


def robust_body(proof: CaseProof | None, choices: Sequence[OptimalChoice] | None) -> Body:
    """What was asked for beside the case itself; nothing where nothing was, or could be."""
    asked: Body = {}
    if proof is not None:
        asked["proof"] = proof_body(proof)
    if choices is not None:
        asked["optimal"] = optimal_body(choices)
    return asked


def proof_words(proof: CaseProof) -> list[str]:
    """Proofs of a case in sentences."""
    words = []
    for proven in proof.settings:
        words.append(f"The {proven.name} settings: {_worst_words(proven.proof)}")
        words += [proven.proof.certificate, proven.largest.sentence]
    return words + joint_words(proof)


def joint_words(proof: CaseProof) -> list[str]:
    """The speed of SIMC that is proven with all parameters off at once, in a sentence."""
    joint = proof.joint_tau_c
    if joint is not None:
        return [
            f"SIMC is proven with all parameters off by up to 50 % at once from tau_c = "
            f"{joint.tau_c:.4g} s ({_settings_words(joint.pid)}); one at a time it passes from "
            f"{joint.alone:.4g} s."
        ]
    return [proof.joint_refusal] if proof.joint_refusal else []


def _worst_words(proof: BoxProof) -> str:
    if proof.stable is False:
        return "not every plant within ±50 % of all parameters at once is stable."
    shown = [
        f"{TITLES[name]} {case.found:.4g}{UNITS[name]} "
        f"(no worse than {case.bound:.4g}{UNITS[name]})"
        for name, case in proof.worst.items()
        if math.isfinite(case.bound)
    ]
    return "worst over ±50 % of all parameters at once: " + ", ".join(shown) + "."


def optimal_words(choices: Sequence[OptimalChoice]) -> list[str]:
    """Optimal settings of a case in sentences."""
    words = []
    for choice in choices:
        name = choice.structure
        if choice.over_box is not None:
            found = choice.over_box.settings
            proven = "proven" if choice.over_box.verdict.holds else "not proven within the budget"
            words.append(
                f"Optimal {name} over ±50 % of all parameters at once ({proven}): "
                f"{_optimum_words(found)}."
            )
        if choice.over_draws is not None:
            part = choice.over_draws
            words.append(
                f"Optimal {name} over what the record leaves open: "
                f"{_optimum_words(part.settings)}; the limits hold on "
                f"{part.draws - part.missed} of {part.draws} draws, a probability of at least "
                f"{100 * part.at_least:.0f} % with 95 % confidence."
            )
        if choice.front is not None:
            words.append(f"Optimal {name} at the model from calm to fast:")
            words += [
                f"Ms {point.margins.Ms:.2f}: {_optimum_words(point)}"
                for point in choice.front.points
            ]
        words += choice.refusals
    return words


def _optimum_words(found: OptimalSettings) -> str:
    return f"{_settings_words(found.pid)}, load IAE {found.load_IAE:.4g}"


def _settings_words(pid: PID) -> str:
    derivative = f", Td = {pid.Td:.4g} s" if pid.Td else ""
    return f"Kc = {pid.Kc:.4g}, Ti = {pid.Ti:.4g} s{derivative}"
