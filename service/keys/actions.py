"""What administrators do with API keys."""

import hashlib
import hmac
import re
import secrets
import unicodedata

from sqlalchemy.orm import Session

from service import audit
from service.actors import Actor, Role
from service.errors import LastAdminKey, NotAuthenticated
from service.keys import store
from service.tables import KeyRow, now

# Public part (12 hexadecimal digits) and secret (256 bits in base 64).
_TOKEN = re.compile(r"lw_([0-9a-f]{12})_([A-Za-z0-9_-]{43})")


def create_key(
    session: Session, *, owner: str, role: Role, actor: Actor | None = None
) -> tuple[KeyRow, str]:
    """Make an API key and hand out its token, which is shown this once.

    Parameters
    ----------
    session : Session
        Transaction; the caller ends it.
    owner : str
        Person the key belongs to.
    role : Role
        What they may do.
    actor : Actor, optional
        Who creates it; none for the command line on the server itself.

    Returns
    -------
    KeyRow, str
        The key as stored, and `lw_<public part>_<secret>`.
    """
    creator = actor or Actor(owner="command line", role=Role.ADMIN)
    secret = secrets.token_urlsafe(32)
    row = KeyRow(
        id=secrets.token_hex(6),
        owner=unicodedata.normalize("NFKC", owner).strip(),
        role=role.value,
        secret_sha256=_digest(secret),
        created_by=creator.owner,
    )
    store.add_key(session, row)
    audit.record(
        session,
        actor=creator,
        action="key.created",
        subject=f"keys/{row.id}",
        after={"owner": row.owner, "role": row.role},
    )
    return row, f"lw_{row.id}_{secret}"


def revoke_key(session: Session, *, actor: Actor, key_id: str) -> KeyRow:
    """Put a key out of force for good; a second time changes nothing.

    Raises
    ------
    LastAdminKey
        It is the only admin key in force.
    """
    admins = store.admin_keys(session)
    row = store.key_with_id(session, key_id)
    if row.revoked_at is not None:
        return row
    if [admin.id for admin in admins] == [row.id]:
        raise LastAdminKey
    row.revoked_at, row.revoked_by = now(), actor.owner
    audit.record(
        session,
        actor=actor,
        action="key.revoked",
        subject=f"keys/{row.id}",
        before={"owner": row.owner, "role": row.role, "revoked_at": None},
        after={"owner": row.owner, "role": row.role, "revoked_at": row.revoked_at},
    )
    return row


def actor_with_token(session: Session, token: str) -> Actor:
    """Find who holds a token.

    Raises
    ------
    NotAuthenticated
        The token is not one of ours, or its key is revoked. The answer does not say which part
        was wrong.
    """
    parts = _TOKEN.fullmatch(token)
    row = store.find_key(session, parts[1]) if parts else None
    if (
        parts is None
        or row is None
        or not hmac.compare_digest(row.secret_sha256, _digest(parts[2]))
    ):
        raise NotAuthenticated("This is not a valid API key.")
    if row.revoked_at is not None:
        raise NotAuthenticated("This API key was revoked.")
    return Actor(owner=row.owner, role=Role(row.role), key_id=row.id)


def _digest(secret: str) -> str:
    """Hash a secret of 256 random bits; such a one needs no slow, salted hash."""
    return hashlib.sha256(secret.encode()).hexdigest()
