"""Rules of the house that no reviewer should have to remember."""

import inspect
import re
from pathlib import Path

from loop import errors

ROOT = Path(__file__).parent.parent
ROOMS = (
    "loop", "identification", "tuning", "monitoring", "historian", "advice", "service",
)  # fmt: skip
SOURCES = sorted(file for room in ROOMS for file in (ROOT / room).rglob("*.py"))
NAMES_THAT_SAY_NOTHING = {"utils", "helpers", "common", "base", "manager", "misc"}


def test_every_file_holds_one_idea_under_a_name_that_tells_it() -> None:
    for file in SOURCES:
        text = file.read_text("utf-8")
        # 400 lines is the soft ceiling; what grows on past it holds a second idea.
        assert text.count("\n") <= 430, file
        assert file.stem not in NAMES_THAT_SAY_NOTHING, file
        unfinished = re.search(
            r"\b(TODO|FIXME|XXX|raise NotImplementedError|pragma: no cover)\b", text
        )
        assert unfinished is None, file


def test_every_engineering_fact_has_a_problem_page() -> None:
    pages = {page.stem for page in (ROOT / "docs" / "problems").glob("*.md")}
    for name, kind in vars(errors).items():
        if inspect.isclass(kind) and issubclass(kind, errors.LoopError):
            if kind is errors.LoopError:
                continue
            slug = re.sub(r"(?<!^)(?=[A-Z])", "-", name).lower()
            renamed = {"disk-full": "storage-full"}
            assert renamed.get(slug, slug) in pages, name


def test_the_index_of_the_methods_lists_every_page_once() -> None:
    folder = ROOT / "docs" / "methods"
    listed = re.findall(r"\]\(([\w-]+\.md)\)", (folder / "README.md").read_text("utf-8"))
    assert sorted(listed) == sorted({page.name for page in folder.glob("*.md")} - {"README.md"})


def test_no_address_of_a_registry_and_no_path_of_a_machine_is_committed() -> None:
    wanted = re.compile(r"https?://[^ \"]*/simple\b|--(extra-)?index-url|/(home|root|work)/\w")
    for file in [*SOURCES, *ROOT.glob("requirements/*.txt"), *ROOT.glob("*.md"), ROOT / "Makefile"]:
        found = wanted.search(file.read_text("utf-8"))
        assert found is None, f"{file.relative_to(ROOT)}: {found}"


def test_every_pinned_package_carries_hashes() -> None:
    for file in ROOT.glob("requirements/*.txt"):
        blocks = re.split(r"\n(?=[a-z0-9])", file.read_text("utf-8"))
        assert all("--hash=sha256:" in block for block in blocks if "==" in block), file.name


def test_the_lock_holds_what_the_project_asks_for() -> None:
    text = (ROOT / "pyproject.toml").read_text("utf-8")
    asked = re.search(r"\ndependencies = \[(.*?)\n\]", text, re.DOTALL)
    assert asked is not None
    names = re.findall(r'^  "([a-zA-Z0-9_-]+)', asked[1], re.MULTILINE)
    for lock in ("runtime", "dev", "bench"):
        pinned = (ROOT / "requirements" / f"{lock}.txt").read_text("utf-8")
        for name in names:
            assert re.search(rf"^{name}(\[\w+\])?==", pinned, re.MULTILINE), (lock, name)
