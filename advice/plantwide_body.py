"""What loops have in common, as the JSON document that the command line prints and the API answers.

null stands for a number that does not exist; NaN and infinity never appear.
"""

from advice.assessment_body import fields_body
from advice.body import Body
from advice.plantwide_result import PlantOscillations


def plantwide_body(found: PlantOscillations) -> Body:
    """Turn what was found into a JSON document; every field keeps its name."""
    # A list of pairs even where it could be an object: that is what the API has always answered.
    return fields_body(found) | {"left_out": [[tag, reason] for tag, reason in found.left_out]}
