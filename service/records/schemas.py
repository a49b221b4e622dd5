"""Form fields of an upload, and the bodies of records and samples."""

from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal, Self, TypeAlias
from uuid import UUID

from fastapi.exceptions import RequestValidationError
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from historian.options import TIME_FORMATS, Columns, Layout, ReadOptions
from loop.record import Mode
from service.records.progress import ProgressBody
from service.schemas import Answer
from service.units import Moment

Stated: TypeAlias = Annotated[str, Field(min_length=1, max_length=200)]
Line: TypeAlias = Annotated[int, Field(ge=0, le=10_000_000)]
State: TypeAlias = Literal["pending", "stored", "failed"]
ModeName: TypeAlias = Literal["UNKNOWN", "MAN", "AUTO", "CAS", "REMOTE"]


class UploadForm(BaseModel):
    """What the sender may state about the file; everything left out is decided from the file."""

    model_config = ConfigDict(extra="forbid")

    tag: Stated | None = Field(None, description="Loop to take, where the file holds several.")
    start: Moment | None = Field(
        None, description="Instant of time 0, for a file that tells elapsed time."
    )
    time_zone: Stated | None = Field(
        None, description="Zone of times that state none.", examples=["Europe/Berlin"]
    )
    time_format: Stated | None = Field(
        None, description="Kind of time.", examples=list(TIME_FORMATS)[:3]
    )
    day_first: bool | None = Field(None, description="Whether 03/04/2024 is the 3rd of April.")
    delimiter: Stated | None = Field(None, description="What separates cells; tab for a tab.")
    decimal: Literal[".", ","] | None = Field(None, description="What marks decimals.")
    encoding: Stated | None = Field(None, description="Text encoding.", examples=["latin-1"])
    layout: Literal["wide", "long", "pairs"] | None = Field(
        None, description="How samples lie in the file."
    )
    header_line: Line | None = Field(None, description="Line of the column names, 0 for none.")
    first_line: Line | None = Field(None, description="Line of the first sample.")
    time: Stated | None = Field(None, description="Column of the time, by name or number.")
    date: Stated | None = Field(None, description="Column of the date, where it is apart.")
    tag_column: Stated | None = Field(None, description="Column of tag names, in a long file.")
    value: Stated | None = Field(None, description="Column of values, in a long file.")
    quality: list[Stated] = Field([], description="Columns of quality.")
    good_quality: list[Stated] = Field([], description="Cells of them that mean good.")
    pv: Stated | None = Field(None, description="Column or tag of the process variable.")
    sp: Stated | None = Field(None, description="Column or tag of the set point.")
    op: Stated | None = Field(None, description="Column or tag of the controller output.")
    mode: Stated | None = Field(None, description="Column or tag of the mode.")
    mode_code: list[Stated] = Field(
        [], description="Meaning of a mode code; repeatable.", examples=["1=AUTO"]
    )
    pv_unit: Stated | None = Field(None, description="Unit of PV, where the file is wrong.")
    op_unit: Stated | None = Field(None, description="Unit of OP, where the file is wrong.")

    @model_validator(mode="after")
    def _must_be_options(self) -> Self:
        self.options(max_bytes=1)  # the reader's own rules decide, and its sentence is the answer
        return self

    @classmethod
    def of(cls, fields: Mapping[str, tuple[str, ...]]) -> Self:
        """Read the fields of a form; an empty one counts as left out.

        Raises
        ------
        RequestValidationError
            A field is unknown, wrong, or given twice.
        """
        stated: dict[str, object] = {}
        for name, values in fields.items():
            filled = [value for value in values if value != ""]
            takes_many = name in cls.model_fields and cls.model_fields[name].default == []
            if filled:
                stated[name] = filled[0] if len(filled) == 1 and not takes_many else filled
        try:
            return cls.model_validate(stated)
        except ValidationError as error:
            faults = [
                {**fault, "loc": ("body", *fault["loc"])}
                for fault in error.errors(include_context=False, include_input=False)
            ]
            raise RequestValidationError(faults) from error

    def options(self, *, max_bytes: int) -> ReadOptions:
        """Turn the form into what the reader takes.

        Parameters
        ----------
        max_bytes : int
            Largest file, after unpacking. [byte]

        Raises
        ------
        ValueError
            A value cannot be.
        """
        return ReadOptions(
            encoding=self.encoding,
            delimiter="\t" if self.delimiter in ("tab", "\\t") else self.delimiter,
            decimal=self.decimal,
            layout=None if self.layout is None else Layout(self.layout),
            header_line=self.header_line,
            first_line=self.first_line,
            time_format=self.time_format,
            day_first=self.day_first,
            time_zone=self.time_zone,
            columns=Columns(
                time=_column(self.time),
                date=_column(self.date),
                tag=_column(self.tag_column),
                value=_column(self.value),
                quality=tuple(_column(name) or name for name in self.quality) or None,
                pv=_column(self.pv),
                sp=_column(self.sp),
                op=_column(self.op),
                mode=_column(self.mode),
            ),
            mode_codes=dict(_mode_code(text) for text in self.mode_code),
            good_quality=frozenset(self.good_quality) or None,
            pv_unit=self.pv_unit,
            op_unit=self.op_unit,
            max_bytes=max_bytes,
        )


def _column(stated: str | None) -> str | int | None:
    return int(stated) if stated is not None and stated.isdecimal() else stated


def _mode_code(text: str) -> tuple[int | str, Mode]:
    code, _, name = text.rpartition("=")
    if not code or name.upper() not in Mode.__members__:
        names = ", ".join(Mode.__members__)
        raise ValueError(f"mode_code must be CODE=MODE with a MODE of {names}, got {text!r}")
    return (int(code) if code.lstrip("-").isdecimal() else code), Mode[name.upper()]


def upload_form() -> dict[str, object]:
    """Describe the form of an upload for the API's own description."""
    schema: dict[str, Any] = UploadForm.model_json_schema()
    file = {"type": "string", "format": "binary", "description": "The export; also .gz or .zip."}
    form = {
        "type": "object",
        "title": "UploadForm",
        "description": schema["description"],
        "properties": {"file": file, **schema["properties"]},
        "required": ["file"],
        "additionalProperties": False,
    }
    return {"requestBody": {"required": True, "content": {"multipart/form-data": {"schema": form}}}}


class RecordBody(Answer):
    """One upload: what was read, how it was read, and what became of every row."""

    id: UUID
    loop_id: UUID
    state: State
    file_name: str
    sha256: str
    bytes: int
    samples: int = Field(description="Samples of the loop in the file.")
    first_time: datetime | None
    last_time: datetime | None
    decisions: dict[str, object]
    accounting: dict[str, object]
    created_at: datetime
    author: str


class PendingBody(Answer):
    """An upload that is under way; nothing of it is stored yet."""

    id: UUID
    loop_id: UUID
    state: Literal["pending"] = "pending"
    progress: ProgressBody


class RecordPage(Answer):
    """Records of a loop, newest first, and the cursor of the next page."""

    items: list[RecordBody]
    next: str | None


class SignalBody(Answer):
    """Points of a signal; null marks a gap."""

    time: list[str] = Field(description="Instants in UTC, increasing.")
    values: list[float | None]


class ModeBody(Answer):
    """The mode where it changes; it holds until the next change."""

    time: list[str] = Field(description="Instants in UTC, increasing.")
    values: list[ModeName]


class SamplesBody(Answer):
    """Samples of a loop, few enough to draw, with their extremes and gaps."""

    loop_id: UUID
    samples: int = Field(description="Samples in the range, before thinning.")
    first_time: datetime | None
    last_time: datetime | None
    max_points: int
    pv: SignalBody
    sp: SignalBody
    op: SignalBody
    mode: ModeBody
