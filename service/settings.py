"""What an installation may set, from LOOPWRIGHT_* environment variables."""

from pathlib import Path

from pydantic import Field
from pydantic_settings import BaseSettings, SettingsConfigDict
from sqlalchemy import URL, make_url


class Settings(BaseSettings):
    """Settings of one installation; every field is an environment variable LOOPWRIGHT_<NAME>."""

    model_config = SettingsConfigDict(env_prefix="LOOPWRIGHT_", frozen=True)

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
    log_json: bool = Field(True, description="Log one JSON object a line; otherwise plain text.")

    @property
    def url(self) -> URL:
        """Address of the database."""
        if self.database_url is None:
            return URL.create("sqlite", database=str(self.data.resolve() / "loopwright.sqlite"))
        return make_url(self.database_url)
