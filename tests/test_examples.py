"""Every example, and the README's code, runs as it stands and prints what is said of it."""

import re
import runpy
import sys
from pathlib import Path

import pytest
from steerclear.policies.entrants import catalogue
from steerclear.shield.barriers import registry
from steerclear.shield.platforms.registry import PLATFORMS
from steerclear.shield.wrappers import readers

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "docs" / "examples"
LOG = ROOT / "tests" / "shield" / "bridge" / "data" / "log_0.8.0.mcap"
SAYS = {
    "ablation": "shield off: ",
    "batched_training": "24 learners",
    "count_collisions": "judged in hindsight: ",
    "draw_barrier": "opponent pursues: h < 0 on 32 m2",
    "draw_decision": "the best keeps 0.26 m, the shield 0.26 m",
    "first_decision": "BACKUP 111.1 deg",
    "masked_ppo": "12 learners, 17 actions each, ",
    "own_barrier": "nearest: 0.",
    "own_encounter": "without a shield 0.03 m",
    "own_loop": "shield on: nearest 3.",
    "own_platform": "launch turns to",
    "own_policy": "every boat straight to the flag",
    "own_reader": "shield on: nearest 3.",
    "policy_over_moos": "m towards the flag over MOOS",
    "read_black_box": "12 decisions of blue_1",
    "wrap_env": "PASSED margin",
    "wrap_policy": "commands changed: ",
}


@pytest.fixture(autouse=True)
def nothing_stays_registered(monkeypatch):
    monkeypatch.setattr(catalogue, "_ENTRANTS", dict(catalogue._ENTRANTS))
    monkeypatch.setattr(readers, "_REGISTERED", dict(readers._REGISTERED))
    monkeypatch.setattr(registry, "BARRIERS", dict(registry.BARRIERS))
    before = set(PLATFORMS)
    yield
    for name in set(PLATFORMS) - before:
        del PLATFORMS[name]


def test_every_example_is_run_and_shown():
    names = {path.stem for path in EXAMPLES.glob("*.py")}
    assert names == set(SAYS)


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.real_time) if name == "policy_over_moos" else name for name in SAYS]
)
def test_an_example_runs(name, capsys, monkeypatch):
    monkeypatch.setattr(sys, "argv", [name, str(LOG)])
    runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    assert SAYS[name] in capsys.readouterr().out


def decided(text, capsys):
    exec(compile(text, "first_decision", "exec"), {})
    return capsys.readouterr().out.strip()


def test_the_tutorial_compares_the_same_games_without_a_shield_and_with_one():
    page = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    without, with_it = [line for line in page.splitlines() if line.startswith(".venv/bin/steerclear evaluate")]
    assert with_it == f"{without} --shield"


def test_the_tutorial_explains_what_its_program_prints(capsys):
    page = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    text = (EXAMPLES / "first_decision.py").read_text(encoding="utf-8")
    after = page.partition("examples/first_decision.py")[2].partition("\n## ")[0]
    (printed,) = re.findall(r"^```text\n(.*?)\n```$", after, flags=re.M | re.S)
    assert printed == decided(text, capsys)
    explained = re.findall(r"^- `(.*?)`:", after, flags=re.M)
    assert " ".join(explained) == printed
    assert "farther off (8 m) and the reason is `PASSED`" in after
    assert decided(text.replace("[0, 5.3]", "[0, 8.0]"), capsys).startswith("PASSED 0.0 deg")


def test_examples_are_short():
    for path in EXAMPLES.glob("*.py"):  # those that draw the docs' figures have lines of axes and labels besides
        most = 90 if path.stem.startswith("draw_") else 45
        most = 120 if path.stem == "own_reader" else most  # half of it is the game that is read
        assert len(path.read_text(encoding="utf-8").splitlines()) <= most, path.name


def test_the_readme_prints_what_it_says(capsys):
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    decision, game = re.findall(r"```python\n(.*?)```", readme, flags=re.DOTALL)
    assert decided(decision, capsys) == re.search(r"## One decision.*?```text\n(.*?)\n```", readme, re.DOTALL).group(1)
    assert decided(game, capsys) == re.search(r"\.reason\.name\)  # (\w+);", game).group(1)
