"""Pages: links and anchors lead somewhere, every page is in the site, and the site builds without a warning."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import typer
import yaml
from steerclear.experiments.cli import app

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
GENERATED = {"studies/json_keys.md", "studies/table_cards.md"}
"""Pages that the site's hooks make of the code."""
LINK = re.compile(r"(?<!\\)\]\(([^)\s]+)\)")


def text_of(page):
    """A page without its code."""
    text = re.sub(r"```.*?```", "", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return re.sub(r"`[^`\n]*`", "", text)


def anchors_of(page):
    """What `page#...` may name: its headings, as sites and GitHub write them."""
    heads = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_links_lead_somewhere(page):
    for link in LINK.findall(text_of(page)):
        if re.match(r"[a-z]+:", link):
            continue
        name, _, anchor = link.partition("#")
        target = (page.parent / name).resolve() if name else page
        if target.is_relative_to(DOCS) and target.relative_to(DOCS).as_posix() in GENERATED:
            continue
        assert target.exists(), link
        assert not anchor or anchor in anchors_of(target), link


def test_programs_on_pages_are_the_examples_that_are_run():
    """Each example is on some page: short ones as a whole, of others a part or a link."""
    whole, linked = set(), ""
    for page in DOCS.rglob("*.md"):
        text = page.read_text(encoding="utf-8")
        linked += text
        for name, shown in re.findall(r"\(examples/(\w+\.py)\)[^\n]*\n\n```python\n(.*?)^```$", text, re.M | re.S):
            program = program_of(DOCS / "examples" / name)
            assert shown in program, name
            whole |= {name} if shown == program else set()
    for example in (DOCS / "examples").glob("*.py"):
        assert f"(examples/{example.name})" in linked, example.name
        assert example.name in whole or len(program_of(example).splitlines()) > 30, example.name


def program_of(example):
    """An example's text without its docstring."""
    return example.read_text(encoding="utf-8").split('"""', 2)[2].lstrip("\n")


def test_blocks_of_code_end_on_a_line_of_their_own_and_a_page_has_a_next_step():
    """A formatter that runs a block's lines together leaves all that follows in it."""
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        fences = re.findall(r"^ *```.*$", text, flags=re.MULTILINE)
        assert len(fences) == text.count("```"), page
        assert all(fence.strip() == "```" for fence in fences[1::2]), page
        if page.parent == DOCS and page.name != "README.md":
            assert re.search(r"^(Next: |## (\d+\. )?On from here)", text, flags=re.MULTILINE), page


MOST_LINES, WIDEST = 3_000, 120
"""Lines of all pages together, without studies and without parts that are made of the code; characters of a line."""


def typed_lines(text):
    """Lines of a page that somebody wrote."""
    return re.sub(r"^<!-- (\w+) -->\n.*?^<!-- /\1 -->\n", "", text, flags=re.MULTILINE | re.DOTALL).splitlines()


def test_pages_are_short_and_their_lines_not_dense():
    pages = {page.name: typed_lines(page.read_text(encoding="utf-8")) for page in DOCS.glob("*.md")}
    assert sum(map(len, pages.values())) <= MOST_LINES, {name: len(lines) for name, lines in pages.items()}
    for name in pages:
        prose = re.sub(r"\$\$.*?\$\$", "", text_of(DOCS / name), flags=re.DOTALL).splitlines()
        assert [line for line in prose if len(line) > WIDEST and not line.startswith(("|", "    "))] == [], name


def test_parts_made_of_the_code_are_no_lines_of_a_page():
    assert typed_lines("a\n<!-- x -->\nb\n<!-- /x -->\nc\n") == ["a", "c"]


def test_a_link_and_an_anchor_are_found():
    assert LINK.findall("see [a](b.md#c) and ![d](e.png)") == ["b.md#c", "e.png"]
    assert "one-decision" in anchors_of(DOCS / "shield.md")


def nav_pages(entries):
    """Files that a navigation names."""
    for entry in entries:
        for value in entry.values():
            yield from [value] if isinstance(value, str) else nav_pages(value)


def test_every_page_is_in_the_site():
    nav = yaml.safe_load((ROOT / "mkdocs.yml").read_text(encoding="utf-8"))["nav"]
    assert sorted(nav_pages(nav)) == sorted(
        GENERATED | {page.relative_to(DOCS).as_posix() for page in DOCS.rglob("*.md")}
    )


def test_troubleshooting_has_texts_that_are_said():
    """Each text in its first column, but for what differs from case to case and what others say."""
    sources = [path for name in ("shield", "env", "policies", "experiments") for path in (ROOT / name).rglob("*.py")]
    said = "\n".join(path.read_text(encoding="utf-8") for path in sources)
    said = re.sub(r'"\s*\n\s*f?"', "", said).replace("{ENTRY_FILE}", "solution.py")
    seen = re.findall(r"^\| (.+?) \|", (DOCS / "troubleshooting.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    texts = [text for cell in seen for text in re.findall(r"`([^`]+)`", cell)]
    parts = {part.strip() for text in texts for part in re.split(r"<.*?>|\.\.\.", text)} - {"m", ""}
    missing = {part for part in parts if part not in said}
    assert missing <= {"requires a different Python", "[train]'", "Decision.no_table"}, missing


RETIRED = {
    r"\bfear(s|ed)?\b": "adversary",
    r"\bwanted commands?\b": "nominal command",
    r"\bforeseen?\b": "predicted",
    r"\bbinding\b": "active constraint",
    r"(?<!barrier )certificates?\b": "safety margin, or opponent model",
    r"\bworth\b": "score",
    r"\bslopes?\b": "gradient",
    r"\boracle\b": "post-hoc avoidability analysis",
    r"\bteam-mates?\b": "teammate",
    r"\bvisitors?\b": "intruder",
}
"""Words of earlier versions, and what the glossary has in their place."""


def helps(command, path="steerclear"):
    """(command, its help) of all commands."""
    yield path, " ".join([command.help or "", *(str(getattr(each, "help", "") or "") for each in command.params)])
    for name, each in getattr(command, "commands", {}).items():
        yield from helps(each, f"{path} {name}")


def test_retired_words_stay_out_of_pages_and_help():
    told = {page.name: text_of(page) for page in (ROOT / "README.md", *DOCS.glob("*.md"))}
    told |= dict(helps(typer.main.get_command(app)))
    for where, text in told.items():
        text = text.replace("barrier certificates", "")
        found = {word: instead for word, instead in RETIRED.items() if re.search(word, text, flags=re.IGNORECASE)}
        assert not found, f"{where}: say instead {found}"


def test_the_site_builds_without_a_warning(tmp_path):
    pytest.importorskip("mkdocstrings_handlers.python", reason="extra [docs]")
    for name in ("docs", "mkdocs.yml"):
        whole = shutil.copytree if (ROOT / name).is_dir() else shutil.copy
        whole(ROOT / name, tmp_path / name)
    shutil.copytree(ROOT / ".typing", tmp_path / ".typing")
    done = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    pages = {path.name: path.read_text(encoding="utf-8") for path in (tmp_path / "build" / "site").glob("*.html")}
    assert "<math" in pages["shield.html"]
    assert "arithmatex" not in pages["shield.html"]
    assert "ShieldedParallelEnv" in pages["api.html"]
    assert "check_platform(" in pages["extend.html"]
