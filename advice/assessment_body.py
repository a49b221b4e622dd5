"""An assessment as the JSON document that the command line prints and the API answers.

null stands for a number that does not exist; NaN and infinity never appear.
"""

from dataclasses import fields
from datetime import datetime
from enum import Enum

from advice.assess import Assessment
from advice.body import Body, Json, number
from monitoring.basis import Basis


def assessment_body(assessment: Assessment) -> Body:
    """Turn an assessment into a JSON document; every field keeps its name."""
    body = fields_body(assessment)
    body["assessable"] = assessment.assessable
    return body


def fields_body(result: object) -> Body:
    """Turn any frozen result of monitoring into a JSON document; every field keeps its name."""
    items = fields(result)  # type: ignore[arg-type]
    return {item.name: _json(getattr(result, item.name)) for item in items}


def _json(value: object) -> Json:
    """One value of a frozen result."""
    if isinstance(value, Basis):
        return {
            "share": number(value.share),
            "confidence": value.confidence.value,
            "reasons": list(value.reasons),
            "settings": dict(value.settings),
        }
    if isinstance(value, Enum):
        return str(value.value)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return number(value)
    if isinstance(value, datetime):
        return value.isoformat().replace("+00:00", "Z")
    if isinstance(value, tuple):
        return _listed(value)
    return fields_body(value)


def _listed(values: tuple[object, ...]) -> Json:
    """A list, or an object where the tuple holds names and their numbers."""
    named: Body = {}
    for item in values:
        if not (isinstance(item, tuple) and len(item) == 2 and isinstance(item[0], str)):
            return [_json(each) for each in values]
        named[item[0]] = _json(item[1])
    return named or []
