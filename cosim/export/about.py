"""What an FMU says of itself besides what it computes: who made it, when, and under which terms."""

from __future__ import annotations

import os
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from cosim.errors import MissingFile, WrongValue

#: Where the standard has the entry point of the licenses, by the ending of the file that is given for it.
_LICENSES = "documentation/licenses/license"
_ENDINGS = {".html": ".html", ".htm": ".html", ".spdx": ".spdx"}


@dataclass(frozen=True)
class About:
    """FMI's words. license: a name or a sentence; license_file: the whole text, which goes into the FMU.

    date: as ISO 8601 has it, or `now`; without it, what SOURCE_DATE_EPOCH says, as for all reproducible builds; without
    that, the FMU has no date, and the same blocks give the same file.
    """

    author: str = ""
    version: str = ""
    copyright: str = ""
    license: str = ""
    license_file: Path | None = None
    date: str = ""

    def dated(self) -> About:
        """The same with its date and time in UTC, if there is one. Raises: WrongValue."""
        epoch = os.environ.get("SOURCE_DATE_EPOCH", "")
        if not self.date and not epoch:
            return self
        try:
            if self.date:
                time = datetime.now(UTC) if self.date == "now" else datetime.fromisoformat(self.date)
            else:
                time = datetime.fromtimestamp(int(epoch), UTC)
        except (ValueError, OverflowError, OSError):
            given = f"`{self.date}`" if self.date else f"SOURCE_DATE_EPOCH, `{epoch}`,"
            raise WrongValue(f"{given} is no date", fix="such as 2026-01-31T12:00:00Z, or now") from None
        aware = time if time.tzinfo else time.replace(tzinfo=UTC)
        return replace(self, date=f"{aware.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}")

    def attributes(self) -> dict[str, str]:
        """Those of `fmiModelDescription`."""
        texts = {key: getattr(self, key) for key in ("author", "version", "copyright", "license")}
        return {key: value for key, value in (*texts.items(), ("generationDateAndTime", self.date)) if value}

    def files(self) -> dict[str, bytes]:
        """What goes into the FMU's archive. Raises: MissingFile."""
        if self.license_file is None:
            return {}
        if not self.license_file.is_file():
            raise MissingFile(
                f"there is no file {self.license_file} with a license", fix="give the path of a text file"
            )
        name = _LICENSES + _ENDINGS.get(self.license_file.suffix.lower(), ".txt")
        try:
            return {name: self.license_file.read_bytes()}
        except OSError as error:
            raise MissingFile(f"the license {self.license_file} cannot be read: {error.strerror}") from None
