"""The tuning rules on offer: the one list that API, docs and tests read."""

from collections.abc import Mapping
from types import MappingProxyType

from tuning import (
    amigo,
    cohen_coon,
    imc,
    isimc,
    lambda_pi,
    simc,
    tyreus_luyben,
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
            imc.PI_RULE,
            imc.IMPROVED_PI_RULE,
            imc.PID_RULE,
            imc.PID_WITH_LAG_RULE,
            amigo.RULE,
            tyreus_luyben.RULE,
            cohen_coon.RULE,
            ziegler_nichols_reaction_curve.RULE,
            ziegler_nichols_ultimate.RULE,
        )
    }
)
