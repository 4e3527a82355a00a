"""Hooks of the site (`mkdocs build`): generated pages, formulas as MathML (no network), code for API pages.

mkdocs calls ``on_config``, ``on_files`` and ``on_page_content``.
"""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File
from steerclear.experiments.docs import keys_page
from steerclear.experiments.reach.pages import tables_page
from steerclear.shield.tables.files import read_table

ROOT = Path(__file__).parent.parent
FORMULA = re.compile(r'<(span|div) class="arithmatex">\\([(\[])(.*?)\\[)\]]</\1>', re.DOTALL)


def on_config(config: Any) -> Any:
    """Let mkdocstrings read the packages under their import names."""
    config.plugins["mkdocstrings"].config.handlers["python"]["paths"] = [str(ROOT / ".typing")]
    return config


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are made of the code itself, so that they are always of this version."""
    tables = sorted((ROOT / "shield" / "tables" / "shipped").glob("*.npz"))
    files.append(File.generated(config, "studies/json_keys.md", content=keys_page()))
    cards = tables_page([read_table(table).card.to_json() for table in tables])
    files.append(File.generated(config, "studies/table_cards.md", content=cards))
    return files


def on_page_content(content: str, **_: Any) -> str:
    """Draw the formulas of a page."""
    return FORMULA.sub(lambda found: _mathml(found[3], block=found[2] == "["), content)


def _mathml(latex: str, block: bool) -> str:
    return convert(html.unescape(latex).strip(), display="block" if block else "inline")
