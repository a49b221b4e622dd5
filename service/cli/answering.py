"""The end of every command that answers a question: a document or sentences, or the refusal."""

import json
from collections.abc import Callable
from typing import Annotated, TypeAlias, TypeVar

import typer

from advice.body import Body
from loop.errors import RuleNotApplicable, UnstableLoop

Found = TypeVar("Found")
REFUSED = 3

AsJson: TypeAlias = Annotated[
    bool, typer.Option("--json", help="Print the document that the API answers.")
]


def answer(
    ask: Callable[[], Found],
    *,
    as_json: bool,
    body: Callable[[Found], Body],
    sentences: Callable[[Found], list[str]],
) -> int:
    """Ask, print the answer and return the exit code.

    Parameters
    ----------
    ask : callable
        The walk. A ValueError is a wrong call; an engineering refusal is an answer, code 3.
    as_json : bool
        Whether to print the document.
    body, sentences : callable
        The document, and the answer in words.
    """
    try:
        found = ask()
    except (RuleNotApplicable, UnstableLoop) as reason:
        typer.echo(str(reason), err=True)
        return REFUSED
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    if as_json:
        typer.echo(json.dumps(body(found), indent=1, allow_nan=False))
    else:
        typer.echo("\n".join(sentences(found)))
    return 0
