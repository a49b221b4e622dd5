"""A misspelt query parameter is refused, not ignored: a filter that is not there shows too much."""

from fastapi import Request

from service.errors import InvalidRequest


async def refuse_unknown_parameters(request: Request) -> None:
    """Hold the query parameters of a request against those its operation describes.

    Raises
    ------
    InvalidRequest
        The operation has no such parameter.
    """
    if not request.query_params:
        return
    path = getattr(request.scope.get("route"), "path", "")
    operations = request.app.openapi()["paths"].get(path, {})
    described = operations.get(request.method.lower(), {}).get("parameters", [])
    known = sorted(p["name"] for p in described if p["in"] == "query")
    for name in request.query_params:
        if operations and name not in known:
            choice = f"; it takes {', '.join(known)}" if known else ""
            raise InvalidRequest(f"query/{name}", f"This operation has no such parameter{choice}.")
