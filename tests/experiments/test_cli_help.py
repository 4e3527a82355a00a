"""Help: of every command on one screen, with an example that its own options take; all options by --help-all."""

import re

import pytest
import typer
from steerclear.experiments.cli import app
from steerclear.experiments.console import EXAMPLES, RARE
from typer.testing import CliRunner

SCREEN = 50
"""Lines, at 80 columns."""


def commands(command, path=()):
    if not hasattr(command, "commands"):
        return {" ".join(path): command}
    return {name: one for key, each in command.commands.items() for name, one in commands(each, (*path, key)).items()}


COMMANDS = commands(typer.main.get_command(app))


def shown(name, option="--help"):
    result = CliRunner().invoke(app, [*name.split(), option], env={"COLUMNS": "80", "TERMINAL_WIDTH": "80"})
    assert result.exit_code == 0, result.output
    return result.output


@pytest.mark.parametrize("name", COMMANDS)
def test_help_fits_one_screen_and_ends_with_an_example(name):
    lines = shown(name).splitlines()
    assert len(lines) <= SCREEN
    assert EXAMPLES[name] in " ".join(" ".join(lines).split())


@pytest.mark.parametrize("name", COMMANDS)
def test_an_example_is_a_command_that_can_be_given(name):
    program, *arguments = EXAMPLES[name].split()
    words = name.split()
    assert (program, arguments[: len(words)]) == ("steerclear", words)
    with COMMANDS[name].make_context(name, arguments[len(words) :], ignore_unknown_options=False) as context:
        assert context.args == []


@pytest.mark.parametrize("name", ["ablate", "sim-boats", "play"])
def test_help_all_shows_every_option(name):
    options = {option for each in COMMANDS[name].params for option in each.opts if option.startswith("--")}
    whole = shown(name, "--help-all")
    assert all(re.search(rf"{option}\b", whole.replace("…", "")) for option in options)
    assert options & RARE
    assert not any(re.search(rf"{option}\b", shown(name)) for option in options & RARE)


def test_help_names_whom_opponents_are_taken_for_wherever_a_shield_plays():
    taking = [name for name, one in COMMANDS.items() if any("--profile" in each.opts for each in one.params)]
    assert len(taking) > 4
    assert all("--profile" in shown(name) for name in taking)


def test_the_list_of_platforms_says_what_each_boat_is():
    said = CliRunner().invoke(app, ["platform", "show"]).output
    assert "mctf2024_sim: The 2024 simulator's own boat" in said
    assert "si: speed and turn rate are there at once" in said


def test_every_rare_option_is_some_commands_and_every_example_of_a_command():
    options = {option for command in COMMANDS.values() for each in command.params for option in each.opts}
    assert options >= RARE
    assert EXAMPLES.keys() == COMMANDS.keys()
