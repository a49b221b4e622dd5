"""Feed-forward of a measured load from two models, as a document and in words.

The command line, the REST service and a notebook all call `tuning.feed_forward.feed_forward` and
these.
"""

from dataclasses import asdict

from advice.body import Body, number, process_body
from advice.display import digits
from loop.process import FOPDT
from tuning.feed_forward import FeedForward


def feed_forward_body(found: FeedForward, process: FOPDT, load: FOPDT) -> Body:
    """A feed-forward as the JSON document of command line and API.

    Parameters
    ----------
    found : FeedForward
        What was worked out.
    process, load : FOPDT
        Models from OP to PV, and from the load to PV.
    """
    values: Body = {
        name: number(value) if isinstance(value, float) else value
        for name, value in asdict(found).items()
    }
    return {
        "process": process_body(process),
        "load": process_body(load),
        **values,
        "sentences": list(feed_forward_sentences(found)),
    }


def feed_forward_sentences(found: FeedForward) -> list[str]:
    """A feed-forward in words."""
    dynamics = f"({digits(found.T_lead)} s + 1)/({digits(found.T_lag)} s + 1)"
    delay = f", delayed by {digits(found.delay)} s" if found.delay else ""
    return [
        f"Add {digits(found.gain)} {dynamics} of the load's deviation to the output{delay}.",
        found.sentence,
        f"Peak of PV for a unit load step without feedback: {digits(found.peak_without, 3)} "
        f"without feed-forward, {digits(found.peak_static, 3)} with the static gain alone, "
        f"{digits(found.peak, 3)} with the lead-lag.",
        f"With one parameter of either model off by up to 50 %, {100 * found.worst_part:.3g} % of "
        f"the peak is left at worst, with {found.worst}.",
    ]
