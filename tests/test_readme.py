"""The README's code runs as it stands and prints what it says."""

import re
from pathlib import Path

README = (Path(__file__).parents[1] / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```python\n(.*?)```", README, flags=re.DOTALL)


def run(block):
    """The names a block leaves."""
    left = {}
    exec(compile(block, "README.md", "exec"), left)
    return left


def printed(block, capsys):
    run(block)
    return capsys.readouterr().out.strip()


def test_there_are_as_many_blocks_as_are_run_here():
    assert len(BLOCKS) == 2


def test_one_decision_prints_what_is_said(capsys):
    said = re.search(r"## One decision.*?```text\n(.*?)\n```", README, flags=re.DOTALL).group(1)
    assert printed(BLOCKS[0], capsys) == said


def test_a_wrapped_game_steps_and_tells_its_reason(capsys):
    said = re.search(r"\.reason\.name\)  # (\w+);", BLOCKS[1]).group(1)
    assert printed(BLOCKS[1], capsys) == said
