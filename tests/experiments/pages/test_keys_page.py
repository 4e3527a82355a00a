"""The page of JSON keys in docs/ is what the code says."""

from pathlib import Path

from steerclear.experiments.pages.docs_pages import keys_page

PAGE = Path(__file__).parents[3] / "docs" / "json_keys.md"


def test_the_page_is_made_of_the_keys_there_are():
    assert PAGE.read_text(encoding="utf-8") == keys_page(), "steerclear docs --out docs writes it anew"
