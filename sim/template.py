"""From a page's template to its text, in one step that escapes whatever it is given.

Names of files, joints and robots come from strangers. A template takes them as text
(`{{ title }}`) or as JSON in a block of its own (`{{ data | tojson }}`), and the page's policy lets
no script run but those that lie beside the template. All extend `sim/base.html`.
"""

import base64
import hashlib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from spark.errors import OutputError


@dataclass(frozen=True)
class Template:
    """The template `name` of a `package`, and the scripts beside it, in their order.

    `frames` are the pages inside a frame of it: they are under its policy, too. `server` allows it
    to ask where it comes from, and nothing else.
    """

    package: str
    name: str
    scripts: tuple[str, ...] = ()
    frames: tuple["Template", ...] = ()
    server: bool = False

    def render(self, **fields: object) -> str:
        """The page: a field is text and shown as it is; what is HTML already is `Markup`.

        Raises `OutputError` where a number is none.
        """
        scripts = [Markup(script) for script in self._own]
        template = _ENVIRONMENT.get_template(f"{self.package}/{self.name}")
        try:
            text = template.render(**fields, scripts=scripts, policy=self._policy())
        except ValueError as error:  # of JSON
            raise OutputError(f"no page: it would hold a number that is none ({error})") from error
        # A file's name need not be UTF-8, what is left of it is shown.
        return text.encode("utf-8", "replace").decode()

    @property
    def _own(self) -> list[str]:
        return [_text(self.package, name) for name in self.scripts]

    def _policy(self) -> str:
        """The Content-Security-Policy of a page that runs its own scripts alone."""
        scripts = [script for template in (self, *self.frames) for script in template._own]
        hashes = (base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
        allowed = " ".join(f"'sha256-{each}'" for each in hashes)
        server = "connect-src 'self'; frame-src 'self'; " if self.server else ""
        return (
            f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; "
            f"{server}base-uri 'none'; form-action 'none'"
        )


@cache
def _text(package: str, name: str) -> str:
    return (files(package) / name).read_text(encoding="utf-8")


_ENVIRONMENT = Environment(
    autoescape=True,
    undefined=StrictUndefined,
    loader=FunctionLoader(lambda path: _text(*path.split("/"))),
)
_ENVIRONMENT.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}
