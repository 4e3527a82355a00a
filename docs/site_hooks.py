"""Hooks of the site (`mkdocs build`): formulas become MathML, so that no page needs the network; API pages find code.

mkdocs calls ``on_config`` and ``on_page_content``.
"""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert

ROOT = Path(__file__).parent.parent
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_config(config: Any) -> Any:
    """Let mkdocstrings read the packages under their import names."""
    config.plugins["mkdocstrings"].config.handlers["python"]["paths"] = [str(ROOT / ".typing")]
    return config


def on_page_content(content: str, **_: Any) -> str:
    """Draw the formulas of a page."""
    return FORMULA.sub(lambda found: _mathml(found[3], block=found[2] == "["), content)


def _mathml(latex: str, block: bool) -> str:
    return convert(html.unescape(latex).strip(), display="block" if block else "inline")
