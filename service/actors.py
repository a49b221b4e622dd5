"""Who acts, and what they may do."""

from dataclasses import dataclass
from enum import StrEnum


class Role(StrEnum):
    """What a key may do; each role may do all that those above it in this list may."""

    VIEWER = "viewer"
    ENGINEER = "engineer"
    APPROVER = "approver"
    ADMIN = "admin"

    def covers(self, needed: "Role") -> bool:
        """Tell whether this role may do what another one is needed for."""
        order = list(Role)
        return order.index(self) >= order.index(needed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Actor:
    """The person behind a request.

    Attributes
    ----------
    owner : str
        Name of the person; the audit trail and loop sheets carry it.
    role : Role
        What they may do.
    key_id : str or None
        Public part of their API key; none for the command line on the server itself.
    """

    owner: str
    role: Role
    key_id: str | None = None

    def is_same_person(self, owner: str) -> bool:
        """Compare with a name, whatever its capitals."""
        return self.owner.casefold() == owner.casefold()
