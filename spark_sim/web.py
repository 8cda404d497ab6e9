"""What a browser says of where it asks: words of strangers, which may be no address at all."""

from urllib.parse import urlsplit

LOCAL = ("localhost", "127.0.0.1", "::1")
"""The names of this machine, which its own browser asks for."""


def host_name(host: str) -> str | None:
    """The name in a `Host` header, without the port; None where there is none."""
    try:
        return urlsplit(f"//{host}").hostname
    except ValueError:
        return None


def origin_host(origin: str) -> str | None:
    """Host and port in an `Origin` header; None where it is no address."""
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return None
