"""Draw every figure of the documentation: `python -m docs.figures`, or some by their page."""

import sys

from docs.figures.catalogue import FIGURES
from docs.figures.style import write


def main(pages: list[str]) -> None:
    """Draw the figures of the pages named, all without a name."""
    write({page: FIGURES[page] for page in pages or FIGURES})


if __name__ == "__main__":
    main(sys.argv[1:])
