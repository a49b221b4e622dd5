"""Errors of the service itself. Each is a fact with its attributes and one clear sentence."""


class ServiceError(Exception):
    """The service cannot do what was asked."""


class NotFound(ServiceError):
    """No such record, or none the caller may see."""

    def __init__(self, kind: str, key: object) -> None:
        super().__init__(f"There is no {kind} {key}.")
        self.kind = kind


class NotAuthenticated(ServiceError):
    """The request carries no valid API key."""

    def __init__(self, reason: str) -> None:
        super().__init__(f"{reason} Send a valid key as 'Authorization: Bearer lw_...'.")


class Forbidden(ServiceError):
    """The key's role does not allow this."""

    def __init__(self, role: str, needed: str) -> None:
        super().__init__(f"This needs the role {needed}; the key has the role {role}.")
        self.role = role
        self.needed = needed


class SelfApproval(ServiceError):
    """Who wrote a draft may not approve it."""

    def __init__(self, author: str) -> None:
        super().__init__(f"{author} wrote this draft, so somebody else has to approve it.")
        self.author = author


class TagTaken(ServiceError):
    """Another loop has this tag."""

    def __init__(self, tag: str) -> None:
        super().__init__(f"There is already a loop with the tag {tag}.")
        self.tag = tag


class LastAdminKey(ServiceError):
    """Without this key nobody could manage keys."""

    def __init__(self) -> None:
        super().__init__("This is the last key with the role admin; create another one first.")


class SheetDecided(ServiceError):
    """The sheet is no longer a draft."""

    def __init__(self, version: int, status: str) -> None:
        super().__init__(f"Sheet version {version} is {status}; only a draft can be decided on.")
        self.version = version
        self.sheet_status = status


class NeverInForce(ServiceError):
    """The sheet was never approved, so nothing changed with it."""

    def __init__(self, version: int, status: str) -> None:
        super().__init__(
            f"Sheet version {version} is {status} and was never in force; there is nothing to "
            "compare before and after it."
        )
        self.version = version
        self.sheet_status = status


class NotTheAuthor(ServiceError):
    """Only who wrote a draft may withdraw it."""

    def __init__(self, author: str) -> None:
        super().__init__(
            f"{author} wrote this draft and may withdraw it; an approver can reject it."
        )
        self.author = author


class NoProcess(ServiceError):
    """What is linked carries no process model, so there are no margins."""

    def __init__(self, kind: str) -> None:
        super().__init__(
            f"The {kind} has no process model: it was refused, or is of a kind that has none. "
            "Link another one, or none."
        )
        self.kind = kind


class BlockChanged(ServiceError):
    """The loop's controller block is not the one the draft was written for."""

    def __init__(self, fields: list[str]) -> None:
        super().__init__(
            f"The loop's {', '.join(fields)} changed after this draft was written, so its numbers "
            "would mean something else. Write a new draft."
        )
        self.fields = fields


class JobEnded(ServiceError):
    """The job is over."""

    def __init__(self, state: str) -> None:
        super().__init__(f"This job is {state} already; there is nothing to stop.")
        self.state = state


class StaleVersion(ServiceError):
    """Somebody changed this in the meantime."""

    def __init__(self, current: str) -> None:
        super().__init__(
            f"This was changed in the meantime; its ETag is now {current}. Read it again first."
        )
        self.current = current


class IfMatchMissing(ServiceError):
    """The request does not say which version it changes."""

    def __init__(self) -> None:
        super().__init__("Send the ETag of the version you have read in the If-Match header.")


class InvalidRequest(ServiceError):
    """The request is not valid."""

    def __init__(self, pointer: str, detail: str) -> None:
        super().__init__("The request is not valid.")
        self.errors = [{"pointer": pointer, "detail": detail}]


class TooManyRequests(ServiceError):
    """One caller asked for more than its share."""

    def __init__(self, reason: str, retry_after: int) -> None:
        super().__init__(f"{reason} Try again in {retry_after} s.")
        self.retry_after = retry_after


class UnauditedChange(ServiceError):
    """A change would have been stored without its line in the audit trail."""


class NotReady(ServiceError):
    """The database is not in the state this version of the service needs."""

    def __init__(self, reasons: list[str]) -> None:
        super().__init__(" ".join(reasons))
        self.reasons = reasons
