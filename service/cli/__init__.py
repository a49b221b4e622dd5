"""The `loopwright` command.

Exit codes: 0 answered, 1 failed, 2 called wrongly, 3 refused with reasons. Whatever is not 0 or 3
says one sentence on standard error.
"""

import sys

import typer

from service.cli.commands import app_for
from service.cli.failure import sentence_for

ANSWERED, FAILED, BAD_CALL, REFUSED = 0, 1, 2, 3


def main(arguments: list[str] | None = None) -> None:
    """Run one command and leave with its exit code."""
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


def run(arguments: list[str]) -> int:
    """Run one command and return its exit code."""
    arguments = arguments or ["--help"]
    try:
        command = typer.main.get_command(app_for(arguments))
        code = command.main(arguments, prog_name="loopwright", standalone_mode=False)
    except typer.TyperException as error:
        said = error.format_message().replace("Value error, ", "").rstrip(".")
        say(f"{said}. See: {_asked_of(error)} --help")
        return error.exit_code
    except typer.Exit as end:
        return end.exit_code
    except (typer.Abort, KeyboardInterrupt):
        say("Stopped.")
        return FAILED
    except BrokenPipeError:
        return FAILED
    except Exception as error:  # noqa: BLE001 - the last line before the user: no traceback there
        say(sentence_for(error))
        return FAILED
    return code if isinstance(code, int) else ANSWERED


def _asked_of(error: typer.TyperException) -> str:
    """Name the command that was called wrongly."""
    context = getattr(error, "ctx", None)
    return "loopwright" if context is None else str(context.command_path)


def say(sentence: str) -> None:
    """Tell the user on standard error, where it does not mix with an answer."""
    print(f"loopwright: {sentence}", file=sys.stderr)  # noqa: T201 - this is the command line
