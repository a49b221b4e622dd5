"""The audit trail: one line a change, append-only, chained by hash.

An action records its change in the transaction of the change itself, as its last step, because
the end of the chain stays locked until the transaction ends:

    audit.record(session, actor=actor, action="loop.created", subject=f"loops/{row.id}", ...)

Every route that is not a GET says which line it leaves, and a house test holds it to that:

    @router.post("", openapi_extra=audit.declares("loop.created"))
"""

from service.audit.trail import declares, record

__all__ = ["declares", "record"]
