"""One sentence for whatever stops a command."""

from loop.errors import LoopError


def sentence_for(error: Exception) -> str:
    """Say what went wrong in one sentence, without a traceback.

    Parameters
    ----------
    error : Exception
        What ended the command.
    """
    if isinstance(error, (LoopError, ValueError)):
        return _one_line(str(error))
    if isinstance(error, OSError):
        where = f" {error.filename}" if error.filename else ""
        return f"Cannot use{where}: {error.strerror or error}."
    # Only now: commands without a server should not wait for the database libraries.
    from sqlalchemy.exc import DBAPIError

    from service.errors import InvalidRequest, ServiceError

    if isinstance(error, InvalidRequest):
        return _one_line(" ".join(fault["detail"] for fault in error.errors))
    if isinstance(error, ServiceError):
        return _one_line(str(error))
    if isinstance(error, DBAPIError):
        return f"The database cannot be used: {_one_line(str(error.orig)).rstrip('.')}."
    return f"This should not have happened ({type(error).__name__}: {_one_line(str(error))})."


def _one_line(text: str) -> str:
    return " ".join(text.split()) or "no reason given"
