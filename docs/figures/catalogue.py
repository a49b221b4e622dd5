"""Every figure of the documentation, by the page that shows it."""

from collections.abc import Mapping

from docs.figures import (
    evidence_figures,
    identification_figures,
    relay_figures,
    stiction_figures,
    tuning_figures,
)
from docs.figures.style import Draw

FIGURES: Mapping[str, Draw] = {
    **evidence_figures.FIGURES,
    **identification_figures.FIGURES,
    **relay_figures.FIGURES,
    **stiction_figures.FIGURES,
    **tuning_figures.FIGURES,
}
