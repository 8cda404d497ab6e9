"""From a page's template to its text, in one step that escapes whatever it is given.

Names of files, joints and robots come from strangers. A package's `page.html` takes them as text
(`{{ title }}`) or as JSON in a block of its own (`{{ data | tojson }}`), and the page's policy lets
no script run but the `page.js` beside it.
"""

import base64
import hashlib
from functools import cache
from importlib.resources import files

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from spark.errors import OutputError

_ENVIRONMENT = Environment(autoescape=True, undefined=StrictUndefined)
_ENVIRONMENT.policies["json.dumps_kwargs"] = {"allow_nan": False, "separators": (",", ":")}


def render_page(
    package: str, *, name: str = "page", framed: tuple[str, ...] = (), **fields: object
) -> str:
    """The page of a package, its `page.html` filled with `fields`, its `page.js` and its policy;
    or another of its pages, by `name`.

    A field is text and shown as it is; what is HTML already is `Markup`. A page inside a frame of
    this one is under this one's policy too: `framed` names the packages whose scripts it runs.
    Raises `OutputError` where a number is none.
    """
    own = _text(package, f"{name}.js")
    scripts = (own, *(_text(other, "page.js") for other in framed))
    template = _ENVIRONMENT.from_string(_text(package, f"{name}.html"))
    try:
        text = template.render(**fields, script=Markup(own), policy=_policy(*scripts))
    except ValueError as error:  # of JSON
        raise OutputError(f"no page: it would hold a number that is none ({error})") from error
    # A file's name need not be UTF-8, what is left of it is shown.
    return text.encode("utf-8", "replace").decode()


def _policy(*scripts: str) -> str:
    """The Content-Security-Policy of a page that asks for nothing and runs these scripts alone."""
    hashes = (base64.b64encode(hashlib.sha256(s.encode()).digest()).decode() for s in scripts)
    allowed = " ".join(f"'sha256-{each}'" for each in hashes)
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; img-src data:; "
        "base-uri 'none'; form-action 'none'"
    )


@cache
def _text(package: str, name: str) -> str:
    return (files(package) / name).read_text(encoding="utf-8")
