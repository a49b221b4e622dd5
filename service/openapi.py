"""The API's own description: openapi.json, and a page that lists it without any script.

`python -m service.openapi` writes openapi.json anew after a change of the API.
"""

import json
from html import escape
from pathlib import Path

from fastapi import FastAPI
from fastapi.responses import HTMLResponse

from service.problems import Problem

OPENAPI = Path(__file__).parent.parent / "openapi.json"


def describe(app: FastAPI) -> None:
    """Put what the framework leaves out into the app's description: the shape of problems."""
    generate = app.openapi

    def openapi() -> dict[str, object]:
        description = generate()
        components = description.setdefault("components", {}).setdefault("schemas", {})
        if "Problem" not in components:
            schema = Problem.model_json_schema(ref_template="#/components/schemas/{model}")
            components.update(schema.pop("$defs", {}))
            components["Problem"] = schema
        return description

    app.openapi = openapi  # type: ignore[method-assign]


def docs_page(app: FastAPI) -> None:
    """Serve /docs: every operation with its first sentence."""

    @app.get("/docs", include_in_schema=False)
    def docs() -> HTMLResponse:
        rows = [
            f"<tr><td><code>{method.upper()}</code></td><td><code>{escape(path)}</code></td>"
            f"<td>{escape(operation.get('description', operation.get('summary', '')))}</td></tr>"
            for path, operations in app.openapi()["paths"].items()
            for method, operation in operations.items()
        ]
        return HTMLResponse(
            "<!doctype html><html lang=en><meta charset=utf-8><title>Loopwright API</title>"
            "<style>body{font:15px/1.5 sans-serif;margin:2em auto;max-width:70em;padding:0 1em}"
            "td{padding:.2em .8em .2em 0;vertical-align:top}</style>"
            "<h1>Loopwright API</h1><p>Every request to /v1 carries an API key: "
            "<code>Authorization: Bearer lw_...</code>. The full description is "
            "<a href=/openapi.json>openapi.json</a>; errors are problem documents whose "
            "<code>type</code> is the address of an explanation.</p>"
            f"<table>{''.join(rows)}</table></html>"
        )


def openapi_text(app: FastAPI) -> str:
    """Write the description as openapi.json holds it."""
    return json.dumps(app.openapi(), indent=1, ensure_ascii=False, sort_keys=True) + "\n"


def main() -> None:
    """Write openapi.json anew."""
    from service.app import create_app

    OPENAPI.write_text(openapi_text(create_app()), "utf-8")


if __name__ == "__main__":
    main()
