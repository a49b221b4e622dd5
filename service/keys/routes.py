"""HTTP routes of API keys."""

from typing import Annotated, TypeAlias

from fastapi import APIRouter, Path

from service.access import Admin
from service.audit import declares
from service.database import Reading, Transaction
from service.keys import actions, store
from service.keys.schemas import CreatedKey, KeyBody, KeyPage, NewKey
from service.listing import Cursor, Limit, cursor_after, key_of

router = APIRouter(prefix="/v1/keys", tags=["keys"])
KeyId: TypeAlias = Annotated[str, Path(pattern="^[0-9a-f]{12}$", description="Public part.")]


@router.post("", status_code=201, openapi_extra=declares("key.created"))
def create_key(body: NewKey, actor: Admin, transaction: Transaction) -> CreatedKey:
    """Create an API key. Its token is in this answer and nowhere else."""
    row, token = actions.create_key(transaction, owner=body.owner, role=body.role, actor=actor)
    return CreatedKey(**KeyBody.model_validate(row).model_dump(), token=token)


@router.get("")
def list_keys(_: Admin, reading: Reading, cursor: Cursor = None, limit: Limit = 100) -> KeyPage:
    """List API keys, revoked ones included, without their secrets."""
    rows = store.all_keys(reading, after=key_of(cursor), limit=limit + 1)
    more = cursor_after(rows[limit - 1].id) if len(rows) > limit else None
    return KeyPage(items=[KeyBody.model_validate(row) for row in rows[:limit]], next=more)


@router.delete("/{key_id}", openapi_extra=declares("key.revoked"))
def revoke_key(key_id: KeyId, actor: Admin, transaction: Transaction) -> KeyBody:
    """Revoke an API key for good. The key stays on the list; a second time changes nothing."""
    return KeyBody.model_validate(actions.revoke_key(transaction, actor=actor, key_id=key_id))
