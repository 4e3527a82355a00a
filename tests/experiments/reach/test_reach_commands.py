"""``steerclear reach``: solve, show and check from end to end, with messages that name the remedy."""

from dataclasses import replace

import pytest
from commands import run as command
from steerclear.experiments import cli_reach as reach
from steerclear.experiments.console import ExitCode
from steerclear.experiments.docs import write_pages
from steerclear.experiments.reach.pages import tables_page
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.tables import make
from steerclear.shield.tables.files import CACHE_VARIABLE, SHIPPED, read_table, save_table

HERON = SHIPPED / "heron-heron-worst-case.npz"


@pytest.fixture(autouse=True)
def elsewhere(tmp_path, monkeypatch):
    """Commands run in an empty folder, on a terminal of 80 columns, with an empty cache of tables."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setenv(CACHE_VARIABLE, str(tmp_path / "cache"))


@pytest.fixture
def tiny(monkeypatch):
    """Solves on a grid of a few nodes."""

    def small(*boats, **options):
        problem = problem_of(*boats, **options)
        return replace(problem, grid=replace(problem.grid, n_rho=12, n_psi=8, n_beta=7, n_own=3, n_other=3))

    problem_of = reach.problem_of
    monkeypatch.setattr(reach, "problem_of", small)
    monkeypatch.setattr(reach, "RUNS", 60)


def run(*arguments):
    return command("reach", *arguments)


def flat(text):
    return " ".join(text.split())


def test_a_solved_table_is_cached_shown_drawn_and_checked(tiny, tmp_path):
    boats = ["--own", "heron", "--other", "heron"]
    done = run("solve", *boats, "--other-may", "cooperative", "--quick", "--radius", "2.5", "--jobs", "1")
    assert done.exit_code == ExitCode.OK, done.output
    path = tmp_path / "cache" / "heron-heron-cooperative.npz"
    assert [one.name for one in path.parent.iterdir()] == [path.name]
    assert "from which 2.5 m cannot be kept" in done.output
    assert read_table(path).card.checked_radii_m == (2.5,)
    shown = run("show", *boats, "--other-may", "cooperative")
    assert shown.exit_code == ExitCode.OK, shown.output
    assert "margin on the value" in shown.output
    assert max(map(len, shown.output.splitlines())) <= 80


def test_an_interrupted_solve_says_how_to_go_on(tiny, monkeypatch, tmp_path):
    monkeypatch.setattr(make, "figures", interrupt)
    stopped = run("solve", "--own", "heron", "--other", "heron", "--quick", "--out", "one.npz")
    assert stopped.exit_code == ExitCode.INTERRUPTED
    assert "kept in one.npz.checkpoint: the same command goes on" in flat(stopped.output)
    assert (tmp_path / "one.npz.checkpoint").exists()
    monkeypatch.undo()


def interrupt(*_):
    raise KeyboardInterrupt


def test_a_missing_table_names_the_command():
    failed = run("show", "--own", "large_usv", "--other", "heron")
    assert failed.exit_code == ExitCode.BAD_INPUT
    assert "steerclear reach solve --own large_usv --other heron --other-may worst-case" in flat(failed.output)
    other = run("show", "--own", "surveyor", "--other", "heron", "--file", HERON)
    assert other.exit_code == ExitCode.BAD_INPUT
    assert "is left as it is: name that table's boats, or leave --file out" in flat(other.output)


def test_checks_of_shipped_tables_name_those_that_are_not_converged():
    good = run("check", *sorted(SHIPPED.glob("*-cooperative.npz")), HERON)
    assert good.exit_code == ExitCode.OK, good.output
    everything = run("check")
    assert everything.exit_code == ExitCode.GOAL_MISSED
    assert "heron-surveyor-worst-case.npz: not converged at 2.5 m" in flat(everything.output)
    assert "damaged" not in everything.output


def test_checks_can_fail(tmp_path):
    table = read_table(HERON)
    loose = replace(table.card, convergence={"2.5": {"mean": 0.3, "largest": 0.5}})
    save_table(replace(table, card=loose), tmp_path / "loose.npz")
    save_table(replace(table, card=replace(table.card, convergence={})), tmp_path / "unchecked.npz")
    save_table(replace(table, card=replace(table.card, own="canoe")), tmp_path / "canoe.npz")
    (tmp_path / "broken.npz").write_bytes(HERON.read_bytes()[:999])
    for name, words in {
        "loose": "not converged at 2.5 m: areas differ by 30 %",
        "unchecked": "never checked",
        "canoe": "canoe",
        "broken": "damaged",
    }.items():
        failed = run("check", f"{name}.npz")
        assert failed.exit_code == ExitCode.GOAL_MISSED
        assert words in flat(failed.output)


def test_the_page_of_tables_is_made_of_their_cards(tmp_path):
    done = command("docs", HERON, "--out", tmp_path)
    assert done.exit_code == ExitCode.OK, done.output
    text, card = (tmp_path / "table_cards.md").read_text(), read_table(HERON).card
    assert text == tables_page([card.to_json()])
    assert f"| 2/2 | {' | '.join(f'{area:.1f}' for area in card.areas_m2['2.5']['2/2'])} |" in text
    with pytest.raises(ConfigError, match="card cannot be read"):
        write_pages([{"command": "reach", "card": "{}"}], tmp_path)
