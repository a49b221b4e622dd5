"""What an installation may set, from LOOPWRIGHT_* environment variables."""

from datetime import time
from pathlib import Path

from pydantic import Field, field_validator
from pydantic_settings import BaseSettings, SettingsConfigDict
from sqlalchemy import URL, make_url
from sqlalchemy.exc import ArgumentError


class Settings(BaseSettings):
    """Settings of one installation; every field is an environment variable LOOPWRIGHT_<NAME>."""

    model_config = SettingsConfigDict(env_prefix="LOOPWRIGHT_", frozen=True, env_ignore_empty=True)

    data: Path = Field(
        Path("loopwright-data"),
        description="Folder of the sample store, and of the embedded database.",
    )
    database_url: str | None = Field(
        None,
        description="sqlite:///FILE or postgresql+psycopg://...; by default SQLite in the folder.",
    )
    host: str = Field("127.0.0.1", description="Address to listen on.")
    port: int = Field(8000, ge=0, le=65535, description="Port to listen on.")
    max_body_bytes: int = Field(
        8_000_000, gt=0, description="Largest request body other than an upload. [byte]"
    )
    max_upload_bytes: int = Field(
        2_000_000_000, gt=0, description="Largest upload of an export file. [byte]"
    )
    allow_self_approval: bool = Field(
        False, description="Let the author of a draft approve it, for a site with one engineer."
    )
    daily_at: time | None = Field(
        time(2, 0),
        description="When yesterday's data are assessed, UTC, such as 02:00; off switches it off.",
    )
    job_processes: int = Field(
        2, ge=1, le=256, description="Processes that assess loops beside each other."
    )
    # A tuning takes some 50 ms of one core: this many are all that one core can work out.
    heavy_per_minute: int = Field(
        1_200, ge=0, description="Heavy questions a key may ask in a minute; 0 for no limit."
    )
    # A browser opens six connections, and a fifth of the 40 threads is a fair share for one key.
    heavy_at_once: int = Field(
        8, ge=0, description="Heavy questions of one key under way at a time; 0 for no limit."
    )
    # Mistyped keys come one by one; the secret's 256 bits are what cannot be guessed.
    failed_keys_per_minute: int = Field(
        30, ge=0, description="Wrong keys an address may try in a minute; 0 for no limit."
    )
    log_json: bool = Field(True, description="Log one JSON object a line; otherwise plain text.")

    @field_validator("daily_at", mode="before")
    @classmethod
    def _off_is_never(cls, stated: object) -> object:
        return None if stated == "off" else stated

    @field_validator("daily_at")
    @classmethod
    def _must_be_utc(cls, at: time | None) -> time | None:
        if at is not None and at.utcoffset():
            raise ValueError(f"daily_at is a time in UTC, such as 02:00, got {at.isoformat()}")
        return None if at is None else at.replace(tzinfo=None)

    @field_validator("database_url")
    @classmethod
    def _must_be_an_address(cls, text: str | None) -> str | None:
        try:
            make_url(text or "sqlite://")
        except ArgumentError as error:
            raise ValueError(
                "the database's address must look like sqlite:///FILE or "
                "postgresql://USER:PASSWORD@HOST/NAME"
            ) from error
        return text

    @property
    def url(self) -> URL:
        """Address of the database."""
        if self.database_url is None:
            return URL.create("sqlite", database=str(self.data.resolve() / "loopwright.sqlite"))
        return make_url(self.database_url)
