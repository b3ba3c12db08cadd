# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Settings of the page, and the token that a file holds."""

from __future__ import annotations

import secrets
from dataclasses import dataclass

from dsse_ros.base.fields import FieldError, check_all, field
from dsse_ros.base.private_files import read_private

MIN_TOKEN = 16
"""Characters of a token at least."""


@dataclass(frozen=True, kw_only=True)
class DashboardSettings:
    """Settings of `dashboard`.

    Raises:
        FieldError: If a value is not allowed.
    """

    host: str = field(
        "str",
        "Address to listen on; any other opens the page to the network.",
        "127.0.0.1",
    )
    port: int = field("int", "TCP port of the page; 0 for any free one.", 8080, low=0, high=65535)
    token_file: str = field(
        "str",
        "File that only its owner can use, with the token of browsers: at least "
        f"{MIN_TOKEN} characters; empty for a new one at each start, which is printed.",
        "",
    )
    allowed_hosts: tuple[str, ...] = field("names", "Further host names of the page.", ())
    frame_rate: float = field("float", "Maximum rate of pictures.", 8.0, low=1, high=20, unit="Hz")

    def __post_init__(self) -> None:
        check_all(self)
        if not self.host:
            raise FieldError("host must be an address of this machine, got ''")

    def read_token(self) -> str:
        """Return the token in the file, or a new one.

        Raises:
            FieldError: If the file cannot be read, others than its owner may use it, or it has
                none that is long enough.
        """
        path = self.token_file
        if not path:
            return secrets.token_urlsafe()
        try:
            lines = read_private(path).decode("utf-8").splitlines()
        except UnicodeDecodeError:
            raise FieldError(f"token_file: {path!r} is not text") from None
        except ValueError as error:
            raise FieldError(f"token_file: {error}") from None
        token = lines[0].strip() if lines else ""
        if len(token) < MIN_TOKEN or not (token.isascii() and token.isprintable()):
            raise FieldError(
                f"token_file: the first line of {path!r} must have at least {MIN_TOKEN} printable "
                "ASCII characters"
            )
        return token
