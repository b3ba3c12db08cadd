# Copyright 2026 dsse_ros maintainers
# SPDX-License-Identifier: Apache-2.0
"""Where Cursor on Target may go: to this machine, or anywhere over TLS."""

from __future__ import annotations

from dataclasses import dataclass
from ipaddress import ip_address
from urllib.parse import urlsplit

from dsse_ros.base.defects import reason_of
from dsse_ros.base.fields import FieldError, check_all, field, shown
from dsse_ros.base.private_files import read_private

_FILES = {
    "PYTAK_TLS_CLIENT_CERT": "certificate",
    "PYTAK_TLS_CLIENT_KEY": "key",
    "PYTAK_TLS_CLIENT_CAFILE": "ca_file",
}
"""Names of the settings of TLS, by those of pytak."""


@dataclass(frozen=True, kw_only=True)
class CotSettings:
    """Settings of `cot_gateway`.

    Raises:
        FieldError: If a value is not allowed.
    """

    url: str = field(
        "str",
        "Receiver: udp:// or tcp:// with a loopback address of IPv4, or tls:// with any; each with "
        "a port, such as udp://127.0.0.1:4242.",
        "",
    )
    certificate: str = field("str", "With tls: PEM file of this client's certificate.", "")
    key: str = field(
        "str", "With tls: PEM file of its key without a password, that only its owner can use.", ""
    )
    ca_file: str = field(
        "str", "With tls: PEM file of the authority that has signed the server's certificate.", ""
    )
    period: float = field("float", "Time between reports.", 2.0, low=0.1, high=10.0, unit="s")

    def __post_init__(self) -> None:
        check_all(self)
        try:
            allowed = _is_allowed(self.url)
        except ValueError:
            # Such as a port that is not a number.
            allowed = False
        if not allowed:
            raise FieldError(
                "url must be udp:// or tcp:// with a loopback address of IPv4, or tls://, and have "
                f"a port, got {shown(self.url)}"
            )
        if self.is_tls:
            self._check_files()

    @property
    def is_tls(self) -> bool:
        """Whether the receiver is reached over TLS."""
        return self.url.startswith("tls:")

    @property
    def of_pytak(self) -> dict[str, str]:
        """The settings as pytak names them; its checks of certificate and host name stay on."""
        # Without the suffix, pytak would bind the receiver's port too.
        url = self.url.replace("udp://", "udp+wo://", 1)
        files = {theirs: getattr(self, ours) for theirs, ours in _FILES.items()}
        # By default, pytak admits every cipher.
        of_tls = files | {"PYTAK_TLS_CLIENT_CIPHERS": "DEFAULT"}
        return {"COT_URL": url} | (of_tls if self.is_tls else {})

    def _check_files(self) -> None:
        """Check that TLS can begin with these files."""
        # Tools read the fields without pytak.
        from pytak.client_functions import get_ssl_ctx, get_tls_config

        for name in _FILES.values():
            if not getattr(self, name):
                raise FieldError(f"{name} must be a PEM file with tls, got ''")
        try:
            if b"ENCRYPTED" in read_private(self.key):
                # OpenSSL would ask the terminal for the password.
                raise ValueError(f"{self.key}: must have no password")
        except ValueError as error:
            raise FieldError(f"key: {error}") from None
        try:
            get_ssl_ctx(get_tls_config(self.of_pytak))
        except Exception as error:
            # pytak raises whatever it met: of files, of OpenSSL, its own.
            reason = reason_of_pytak(error)
            raise FieldError(f"certificate, key or ca_file cannot be used: {reason}") from None


def reason_of_pytak(error: Exception) -> str:
    """Return on one line why pytak has failed, which it often hides behind an error of its own."""
    return reason_of(error.__cause__ if isinstance(error.__cause__, Exception) else error)


def _is_allowed(url: str) -> bool:
    """Return whether a receiver is on this machine or is reached over TLS."""
    parts = urlsplit(url)
    host, port = parts.hostname or "", parts.port
    if not port or parts.netloc != f"{host}:{port}" or url != f"{parts.scheme}://{host}:{port}":
        return False
    if parts.scheme == "tls":
        return True
    # A name may lead anywhere, except this one (RFC 6761).
    return parts.scheme in ("udp", "tcp") and (host == "localhost" or _is_loopback(host))


def _is_loopback(host: str) -> bool:
    address = ip_address(host)
    return address.version == 4 and address.is_loopback
