"""Every rule has a page, the page names the source, and its code runs."""

import inspect
import re
from pathlib import Path

import pytest

from tuning.catalogue import RULES
from tuning.profiles import PROFILES
from tuning.rule import Rule

METHODS = Path(__file__).parents[2] / "docs" / "methods"


def page_of(rule: Rule) -> str:
    """The page carries the name of the rule's module."""
    modules = {inspect.getmodule(tune) for tune in rule.structures.values()}
    (module,) = modules
    assert module
    name = module.__name__.rpartition(".")[2].replace("_", "-")
    return (METHODS / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES.keys())
def test_the_page_of_a_rule_names_it_its_source_and_its_default_speed(rule: Rule) -> None:
    page = page_of(rule)
    assert f'RULES["{rule.name}"]' in page
    assert "**Source.**" in page
    assert "**Aim.**" in page
    if rule.status == "confirmed":
        years = re.findall(r"\b(?:19|20)\d\d\b", rule.source)
        assert all(year in page for year in years)
        assert rule.source.split()[0] in page
    else:
        assert "from\nmemory and not confirmed" in page
    if rule.tau_c_text:
        assert rule.tau_c_text in page


@pytest.mark.parametrize(
    "page",
    sorted(
        {
            *(
                METHODS / f"{name}.md"
                for name in (
                    "ziegler-nichols-reaction-curve",
                    "ziegler-nichols-ultimate",
                    "tyreus-luyben",
                    "cohen-coon",
                    "imc",
                    "lambda-pi",
                    "simc",
                    "isimc",
                    "amigo",
                    "amigo-frequency",
                    "chien-hrones-reswick",
                    "kappa-tau",
                    "minimum-error",
                    "pure-delay",
                    "shinskey",
                    "usort",
                    "verification",
                )
            ),
        }
    ),
    ids=lambda page: page.stem,
)
def test_the_code_of_a_page_runs(page: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    names: dict[str, object] = {}
    for block in blocks:
        exec(block, names)  # noqa: S102 - the pages are ours, and this is what keeps them true


def test_the_page_of_the_verification_prints_every_profile() -> None:
    page = (METHODS / "verification.md").read_text(encoding="utf-8")
    for profile in PROFILES.values():
        row = (
            f"| `{profile.name}` | {profile.gain_in_decibels:.0f} dB | {profile.phase}° "
            f"| {profile.Ms} |"
        )
        assert row in page
