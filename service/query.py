"""A misspelt query parameter is refused, not ignored: a filter that is not there shows too much."""

from fastapi import Request
from fastapi.dependencies.models import Dependant
from fastapi.routing import APIRoute

from service.errors import InvalidRequest


async def refuse_unknown_parameters(request: Request) -> None:
    """Hold the query parameters of a request against those its operation takes.

    Raises
    ------
    InvalidRequest
        The operation has no such parameter.
    """
    route = request.scope.get("route")
    if not request.query_params or not isinstance(route, APIRoute):
        return
    known = sorted(_query_parameters(route.dependant))
    for name in request.query_params:
        if name not in known:
            choice = f"; it takes {', '.join(known)}" if known else ""
            raise InvalidRequest(f"query/{name}", f"This operation has no such parameter{choice}.")


def _query_parameters(dependant: Dependant) -> set[str]:
    """Collect what an operation and everything it depends on takes from the query."""
    own = {field.alias for field in dependant.query_params}
    return own.union(*map(_query_parameters, dependant.dependencies))
