"""A case as text on a terminal."""

from rich import box
from rich.console import Console
from rich.table import Table

from advice.display import digits, row_of, rule_name, settings_of
from advice.facts import data_facts, gain_unit, model_facts, stated_facts
from advice.next_test import after, next_test_sentences
from advice.tune import TuningCase
from historian.export import Export

COLUMNS = ("Rule", "Kc", "Ti s", "Td s", "GM dB", "PM °", "DM s", "Ms", "worst Ms", "±50 %")


# Wide enough for every row on one line, also where the output goes to a file.
NARROWEST = 130


def _console() -> Console:
    console = Console(soft_wrap=True, highlight=False)
    console.width = max(console.width, NARROWEST)
    return console


def print_case(case: TuningCase, export: Export, *, title: str) -> None:
    """Print data, model, every rule and the recommendation."""
    out = _console()
    out.print(f"[bold]{title}[/bold]")
    print_reading(out, export)
    _print_facts(out, "Data", [] if case.record is None else data_facts(case.record))
    _print_facts(out, "Model", model_facts(case))
    _print_answer(out, case)


def print_stated_case(case: TuningCase, *, title: str) -> None:
    """Print the process that was stated, what stands for it, every rule and the recommendation."""
    out = _console()
    out.print(f"[bold]{title}[/bold]")
    _print_facts(out, "Process", model_facts(case))
    for reduction in case.reductions:
        model = type(reduction.model).__name__
        neglected = [("neglected", step) for step in reduction.steps]
        _print_facts(out, f"{model} by the half rule", [*stated_facts(reduction.model), *neglected])
    _print_answer(out, case)


def _print_answer(out: Console, case: TuningCase) -> None:
    if case.tunings:
        _print_tunings(out, case)
    out.print()
    best = case.best
    if best is not None and best.proposal.pid is not None:
        settings = ", ".join(settings_of(best.proposal.pid, gain_unit(case.record)))
        out.print(f"[bold]Recommended: {rule_name(best.proposal)}[/bold] (ISA form)")
        out.print(f"  {settings}, {best.proposal.pid.action} action", markup=False)
    else:
        out.print("[bold]No recommendation.[/bold]")
    out.print(f"  {case.recommended_reason}", markup=False)
    _print_next_test(out, case)


def _print_next_test(out: Console, case: TuningCase) -> None:
    following = after(case)
    if following is None:
        return
    out.print("\n[bold]The test to run next[/bold]")
    for sentence in next_test_sentences(following):
        out.print(f"  {sentence}", markup=False)


def print_reading(out: Console, export: Export) -> None:
    """Print what the reader decided and what became of the rows."""
    out.print("\n[bold]File[/bold]")
    for sentence in export.decisions.words:
        out.print(f"  {sentence}", markup=False)
    rows = export.accounting
    out.print(
        f"  {rows.rows_read} rows: {rows.rows_kept} kept, {rows.rows_rejected} rejected, "
        f"{rows.duplicates} duplicates; {rows.gaps} gaps; span {digits(rows.span)} s",
        markup=False,
    )
    for rejection in rows.rejections[:5]:
        out.print(f"  {rejection}", markup=False)
    if len(rows.rejections) > 5:
        out.print(f"  ... and {sum(rows.reasons.values()) - 5} more rejections", markup=False)


def print_model(case: TuningCase, export: Export, *, title: str) -> None:
    """Print data and model alone."""
    out = _console()
    out.print(f"[bold]{title}[/bold]")
    print_reading(out, export)
    _print_facts(out, "Data", [] if case.record is None else data_facts(case.record))
    _print_facts(out, "Model", model_facts(case))
    _print_next_test(out, case)


def _print_facts(out: Console, title: str, facts: list[tuple[str, str]]) -> None:
    if not facts:
        return
    out.print(f"\n[bold]{title}[/bold]")
    width = max(len(name) for name, _ in facts)
    for name, value in facts:
        out.print(f"  {name:<{width}}  {value}", markup=False)


def _print_tunings(out: Console, case: TuningCase) -> None:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, title_justify="left")
    for i, name in enumerate(COLUMNS):
        left = i in (0, len(COLUMNS) - 1)
        table.add_column(name, justify="left" if left else "right", no_wrap=True)
    for i, tuning in enumerate(case.tunings):
        if tuning.proposal.pid is None:
            continue
        row = row_of(tuning, best=i == case.recommended)
        table.add_row(
            row.name, row.Kc, row.Ti, row.Td, row.gain, row.phase, row.delay, row.Ms,
            row.worst_Ms, row.verdict, style="bold" if row.best else None,
        )  # fmt: skip
    out.print(f"\n[bold]Settings[/bold] (ISA form, profile {case.profile.name})")
    out.print(table)
    refusals = [t.proposal.refusal for t in case.tunings if t.proposal.pid is None]
    for sentence in refusals:
        out.print(f"  {sentence}", markup=False)
