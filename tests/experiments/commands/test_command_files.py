"""Nothing that a command reads is written over by what it writes."""

from pathlib import Path

import pytest
from logged_runs import header_of, write_log
from steerclear.experiments.cli import app
from steerclear.experiments.commands.console import ExitCode
from steerclear.experiments.commands.files import check_apart, check_json_file
from steerclear.policies.entrants.learned.entered import FILES
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from typer.testing import CliRunner


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "run.mcap"
    write_log(path, 20, header=header_of(ShieldConfig()))
    return path.read_bytes()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("--html run.mcap", "named twice, by log and by --html"),
        ("--json run.mcap", "named twice, by log and by --json"),
        ("--mend run.mcap", "named twice, by log and by --mend"),
        ("--mend ../here/run.mcap", "named twice, by log and by --mend"),
        ("--record run.mcap", "named twice, by log and by --record"),
        ("--html out.html --json out.html", "named twice, by --html and by --json"),
        ("--html other.mcap", "does not end in .html"),
        ("--record game.html", "does not end in .npz"),
        ("--mend whole.npz", "does not end in .mcap"),
        ("--json other.mcap", "the ending of black boxes"),
        ("--json", "requires an argument"),
    ],
)
def test_a_replay_leaves_the_black_box_alone(more, words, written, tmp_path, monkeypatch):
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    Path("run.mcap").write_bytes(written)
    done = CliRunner().invoke(app, ["replay", "run.mcap", *more.split()], terminal_width=200)
    assert done.exit_code == ExitCode.BAD_INPUT
    assert words in " ".join(done.stderr.split())
    assert [path.name for path in here.iterdir()] == ["run.mcap"]
    assert Path("run.mcap").read_bytes() == written


def test_links_to_one_file_are_that_file(tmp_path):
    (tmp_path / "a.npz").touch()
    (tmp_path / "b.npz").symlink_to("a.npz")
    with pytest.raises(ConfigError, match=r"b\.npz is named twice, by records and by --to"):
        check_apart({"records": [tmp_path / "a.npz"], "--to": tmp_path / "b.npz"})


def test_folders_devices_and_what_is_no_file_may_be_named_twice(tmp_path):
    check_apart({"--out": tmp_path, "sources": [tmp_path], "--json": Path("/dev/null"), "--html": Path("/dev/null")})
    check_apart({"records": [tmp_path / "a.npz", tmp_path / "a.npz"], "seed": 3, "--to": None})


def test_results_may_have_any_ending_that_is_nobody_elses(tmp_path):
    for name in ("results.json", "results", "results.txt"):
        check_json_file(tmp_path / name)
    check_json_file(None)


@pytest.mark.parametrize("folder", [".", "..", "sub"])
def test_a_folder_is_no_record(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("sub").mkdir()
    done = CliRunner().invoke(app, ["render", folder], terminal_width=200)
    assert done.exit_code == ExitCode.BAD_INPUT
    assert "is a folder; name a record in it" in done.stderr


@pytest.mark.parametrize("name", ["../../x y", "a/b", "..", ".hidden", "two words", "", "boat.yaml", "b" * 33, "é"])
def test_a_new_platform_has_a_plain_name_and_lies_where_it_was_begun(name, tmp_path, monkeypatch):
    here = tmp_path / "one" / "two"
    here.mkdir(parents=True)
    monkeypatch.chdir(here)
    done = CliRunner().invoke(app, ["platform", "new", "--", name], terminal_width=200)
    assert done.exit_code == ExitCode.BAD_INPUT
    assert "give 1 to 32 letters, digits" in done.stderr
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == []


def test_a_new_platform_of_a_plain_name_is_written(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(app, ["platform", "new", "my-boat_2.b"]).exit_code == 0
    assert (tmp_path / "my-boat_2.b.yaml").exists()


@pytest.mark.parametrize("option", ["--out there.npz", "--out new.npz --submission there.zip"])
def test_an_export_writes_over_no_file(option, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("there.npz", "there.zip"):
        Path(name).write_text("mine")
    done = CliRunner().invoke(app, ["export", str(FILES["jin"]), *option.split()], terminal_width=200)
    assert done.exit_code == ExitCode.BAD_INPUT
    name, place = option.split()[::-1][:2]
    assert f"{name} is there already; name another {place}" in done.stderr
    assert [path.name for path in sorted(tmp_path.iterdir())] == ["there.npz", "there.zip"]
    assert {path.read_text() for path in tmp_path.iterdir()} == {"mine"}
