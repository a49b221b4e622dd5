"""Every figure of the documentation, by the page that shows it."""

from collections.abc import Mapping

from docs.figures import identification_figures, stiction_figures, tuning_figures
from docs.figures.style import Draw

FIGURES: Mapping[str, Draw] = {
    **identification_figures.FIGURES,
    **stiction_figures.FIGURES,
    **tuning_figures.FIGURES,
}
