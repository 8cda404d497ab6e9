"""Addresses: where poses come from, and where coordinates go."""

import socket
from dataclasses import dataclass
from urllib.parse import urlsplit

from spark.errors import ConventionError

SOURCES = {"vmc": "vmc://:39539", "xsens": "xsens://:9763"}
"""The protocols of poses, each with the address that its senders send to."""
SINKS = {
    "udp": "udp://localhost:9000",
    "zmq": "zmq://*:5556",
    "zmq+push": "zmq+push://localhost:5556",
}
"""How coordinates are sent, each with an example."""
LAYOUTS = ("json", "bytes")
"""What a message of coordinates holds."""


@dataclass(frozen=True)
class Address:
    """`SCHEME://HOST:PORT?LAYOUT`; the host is empty where it is left out."""

    scheme: str
    host: str
    port: int
    layout: str = ""

    def __str__(self) -> str:
        tail = f"?{self.layout}" if self.layout else ""
        return f"{self.scheme}://{self.host}:{self.port}{tail}"


def parse(text: str, known: dict[str, str], *, layouts: tuple[str, ...] = ()) -> Address:
    """An address of one of the `known` schemes. Raises `ConventionError` where it is none, and says
    what is."""
    try:
        parts = urlsplit(text if isinstance(text, str) else "")
        host, port = parts.hostname or "", parts.port
    except ValueError:
        port = None
    else:
        layout = parts.query or (layouts[0] if layouts else "")
        bare = not parts.path.strip("/") and not parts.fragment and not parts.username
        if parts.scheme in known and port is not None and bare and layout in (layouts or ("",)):
            return Address(parts.scheme, host, port, layout)
    *several, last = known.values()
    examples = f"{', '.join(several)} or {last}" if several else last
    ends = f"; it may end in {' or '.join(f'?{each}' for each in layouts)}" if layouts else ""
    raise ConventionError(f"{text}: expected SCHEME://HOST:PORT, such as {examples}{ends}")


def resolved(address: Address) -> tuple[str, int]:
    """Its host as a number, which is looked up once. Raises `ConventionError` where it has none."""
    if not address.host:
        raise ConventionError(f"{address}: there is no host to send to, such as localhost")
    try:
        found = socket.getaddrinfo(address.host, address.port, socket.AF_INET, socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise ConventionError(f"{address}: there is no host {address.host!r}") from error
    return str(found[0][4][0]), address.port
