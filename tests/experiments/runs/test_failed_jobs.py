"""A fault within a job ends a command as one in the command itself does, wherever jobs are run."""

from pathlib import Path

import pytest
from steerclear.experiments import cli
from steerclear.experiments.commands.console import ExitCode
from steerclear.experiments.runs.failed_jobs import JobFault, end_failed
from steerclear.shield.exceptions import ConfigError, GameError
from typer.testing import CliRunner

TRACE = Path(__file__).parents[2] / "data" / "traces" / "heron_random.npz"
COMMANDS = {
    "evaluate": ("evaluate medium --opponents hold --games 1 --max-time 1 --jobs 1", "play.match.Match.play"),
    "tournament": ("tournament --quick --jobs 1", "tournament.campaign.play_game"),
    "encounters": ("encounters --platform heron --family head_on --n 1 --workers 1", "encounters.campaign.play_job"),
    "attack": ("attack --restarts 1 --generations 1 --population 8 --workers 1", "attack.campaign.run_search"),
    "reach play": ("reach play --own heron --other heron --jobs 1", "commands.reach_play.play_set"),
    "parity": (f"parity {TRACE} --jobs 1", "commands.parity.replay_trace"),
}


@pytest.mark.parametrize("name", list(COMMANDS))
@pytest.mark.parametrize(
    ("error", "code"), [(GameError("no such game"), ExitCode.BAD_INPUT), (KeyError("sunk"), ExitCode.FAULT)]
)
def test_a_fault_in_a_job_is_one_of_the_command(name, error, code, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def broken(*_):
        raise error

    line, place = COMMANDS[name]
    monkeypatch.setattr(f"steerclear.experiments.{place}", broken)
    done = CliRunner().invoke(cli.app, line.split(), terminal_width=200)
    assert done.exit_code == code, done.output
    assert ("no such game" in done.output) == (code == ExitCode.BAD_INPUT)
    assert ("this is a fault of steerclear, not of yours (KeyError: 'sunk')" in done.stderr) == (code == ExitCode.FAULT)
    assert "Traceback" not in done.output


def test_one_fault_among_bad_input_is_what_counts():
    bad, fault = {"error": "no such game", "fault": False}, {"error": "sunk", "fault": True}
    with pytest.raises(ConfigError, match=r"^1 game failed \(see above\)$"):
        end_failed([bad], "1 game failed", " (see above)")
    with pytest.raises(JobFault, match=r"^2 games failed: sunk$"):
        end_failed([bad, fault], "2 games failed", " (see above)")
