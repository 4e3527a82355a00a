"""Writing self-contained HTML pages from the templates beside this package."""

from __future__ import annotations

import html
import json
import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.visible import visible


def template(name: str) -> str:
    """Return the text of a template."""
    return (files("steerclear.experiments.report") / "templates" / name).read_text(encoding="utf-8")


def fill(page: str, parts: Mapping[str, str]) -> str:
    """Put parts into a template, each at its ``@@NAME@@``; a part is never searched for further marks.

    Args:
        page: The template's text.
        parts: Text by name.

    Returns:
        The page.
    """
    pieces = page.split("@@")
    return "".join(parts[piece] if place % 2 else piece for place, piece in enumerate(pieces))


def html_page(name: str, parts: Mapping[str, str], sources: str = "") -> str:
    """Put a body into the frame that all pages share.

    Args:
        name: Template of the body.
        parts: Text by name, ``TITLE`` and ``STYLE`` among them.
        sources: What the page may load besides its own style, as further directives of its security policy.

    Returns:
        The page.
    """
    body = fill(template(name), parts).removesuffix("\n")
    return fill(template("page.html"), {**parts, "BODY": body, "SOURCES": sources})


def report_page(name: str, parts: Mapping[str, str], sources: str = "") -> str:
    """As `html_page`, for reports: their title, warnings, headlines, replays and bars stand at ``TOP``."""
    parts = {"WARNINGS": "", **parts}
    return html_page(name, {**parts, "TOP": fill(template("report_top.html"), parts).removesuffix("\n")}, sources)


def as_json(content: Any) -> str:
    """Return JSON that may stand inside a script element whatever texts it holds; they are as `as_text` shows them."""
    text = json.dumps(_visible_in(content), separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")


def as_text(content: Any) -> str:
    """Return text that may stand inside an element or an attribute: no mark-up, nothing that turns letters round."""
    return html.escape(visible(content, keep="\n\t"))


def _visible_in(content: Any) -> Any:
    if isinstance(content, str):
        return visible(content, keep="\n\t\u2028\u2029")
    if isinstance(content, Mapping):
        return {visible(key): _visible_in(value) for key, value in content.items()}
    return [_visible_in(value) for value in content] if isinstance(content, list | tuple) else content


def write_page(path: str | os.PathLike[str], page: str) -> Path:
    """Write a page; the file appears whole or not at all.

    Args:
        path: File to write.
        page: Its text.

    Returns:
        The path written.

    Raises:
        ConfigError: The file cannot be written.
    """
    target = Path(path)
    with whole_file(target, ConfigError) as part:
        part.write_text(page, encoding="utf-8")
    return target
