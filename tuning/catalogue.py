"""The tuning rules on offer: the one list that API, docs and tests read."""

from collections.abc import Mapping
from types import MappingProxyType

from tuning import (
    amigo,
    amigo_frequency,
    chien_hrones_reswick,
    cohen_coon,
    imc,
    isimc,
    kappa_tau,
    lambda_pi,
    least_area,
    minimum_error,
    pure_delay,
    shinskey,
    simc,
    tyreus_luyben,
    usort,
    ziegler_nichols_reaction_curve,
    ziegler_nichols_ultimate,
)
from tuning.rule import Rule

RULES: Mapping[str, Rule] = MappingProxyType(
    {
        rule.name: rule
        for rule in (
            simc.RULE,
            isimc.RULE,
            lambda_pi.RULE,
            lambda_pi.INTEGRATING_RULE,
            pure_delay.RULE,
            imc.PI_RULE,
            imc.IMPROVED_PI_RULE,
            imc.PID_RULE,
            imc.PID_WITH_LAG_RULE,
            amigo.RULE,
            amigo_frequency.RULE,
            *kappa_tau.KAPPA_TAU_RULES,
            *usort.USORT_RULES,
            tyreus_luyben.RULE,
            shinskey.RULE,
            *minimum_error.LOPEZ_RULES,
            *minimum_error.ROVIRA_RULES,
            cohen_coon.RULE,
            *chien_hrones_reswick.CHR_RULES,
            ziegler_nichols_reaction_curve.RULE,
            ziegler_nichols_ultimate.RULE,
        )
    }
)


def rule_of(name: str) -> Rule:
    """Find what a proposal rests on: a published rule, or settings that are computed.

    Parameters
    ----------
    name : str
        Name of the rule in a proposal.
    """
    return least_area.RULE if name == least_area.NAME else RULES[name]
