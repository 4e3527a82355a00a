"""Self-contained HTML pages, filled from ``templates/`` by Jinja; what a page shows is escaped and cannot be obeyed."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import DictLoader, Environment, StrictUndefined
from markupsafe import Markup
from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.foreign import visible

SCRIPT_SOURCES = "; script-src 'unsafe-inline'; img-src data:"
"""What a page with scripts of its own may use, as further directives of its security policy."""


def template(name: str) -> str:
    """Return the text of a template."""
    return (files("steerclear.experiments") / "templates" / name).read_text(encoding="utf-8")


@cache
def _environment() -> Environment:
    pages = {path.name: template(path.name) for path in (files("steerclear.experiments") / "templates").iterdir()}
    found = Environment(
        loader=DictLoader({name: text for name, text in pages.items() if name.endswith(".html")}),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_shown,
    )
    found.globals["style"] = lambda name: Markup(template(name))
    return found


def _shown(content: Any) -> Any:
    """Nothing that turns letters round, or is obeyed otherwise."""
    if isinstance(content, Markup):
        return content
    return visible(content, keep="\n\t") if isinstance(content, str) else content


def render(name: str, **content: Any) -> str:
    """Fill a template.

    Args:
        name: of the template.
        **content: what it shows; text is escaped, `Markup` is not.
    """
    return _environment().get_template(name).render(**content)


def as_json(content: Any) -> Markup:
    """Return JSON that may stand inside a script element whatever texts it holds; they are made visible."""
    text = json.dumps(_visible_in(content), separators=(",", ":"), allow_nan=False)
    return Markup(text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029"))


def _visible_in(content: Any) -> Any:
    if isinstance(content, str):
        return visible(content, keep="\n\t\u2028\u2029")
    if isinstance(content, Mapping):
        return {visible(key): _visible_in(value) for key, value in content.items()}
    return [_visible_in(value) for value in content] if isinstance(content, list | tuple) else content


def write_page(path: str | os.PathLike[str], page: str) -> Path:
    """Write a page; the file appears whole or not at all.

    Raises:
        ConfigError: the file cannot be written.
    """
    target = Path(path)
    with whole_file(target, ConfigError) as part:
        part.write_text(page, encoding="utf-8")
    return target
