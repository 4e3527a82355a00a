"""`steerclear replay` from the command line."""

import dataclasses
import json

import pytest
from logged_runs import Encounter, header_of, write_log
from steerclear.env.record import load
from steerclear.experiments.cli import app
from steerclear.experiments.docs_keys import KEYS, undocumented
from steerclear.shield import ShieldConfig
from steerclear.shield.bridge.blackbox import McapWriter
from typer.testing import CliRunner

STEPS = 160


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Logs: sound; with a lie in it; unshielded, so that boats collide; cut off."""
    folder = tmp_path_factory.mktemp("logs")
    header = header_of(ShieldConfig())
    write_log(folder / "sound.mcap", STEPS, header=header)
    write_log(folder / "lie.mcap", STEPS, header=header, edit=_lie)
    write_log(folder / "crash.mcap", STEPS, header=header, shielded=False)
    writer = McapWriter(folder / "steady.mcap", header, flush_s=0.0)
    for tick in Encounter(header, STEPS):
        writer.take(tick)
    writer.close()
    whole = (folder / "steady.mcap").read_bytes()
    (folder / "cut.mcap").write_bytes(whole[: int(0.4 * len(whole))])
    return folder


def _lie(tick):
    if tick.number != 30:
        return tick
    decisions = dataclasses.replace(tick.decisions, safety_margin_m=tick.decisions.safety_margin_m + 1e-12)
    return dataclasses.replace(tick, decisions=decisions)


def run(*arguments):
    return CliRunner().invoke(app, ["replay", *map(str, arguments)], terminal_width=200)


def test_a_sound_log_is_proved(folder):
    result = run(folder / "sound.mcap")
    assert result.exit_code == 0
    assert "160 of 160 decisions made again, the same bit for bit." in result.output
    assert "2026-09-21" in result.output
    assert "own boats blue_1, blue_2" in " ".join(result.output.split())
    assert "slow" in result.output


def test_a_log_that_lies_is_found_out(folder):
    result = run(folder / "lie.mcap")
    assert result.exit_code == 1
    assert "159 of 160 decisions are the same, 1 differ" in result.output
    text = " ".join(result.output.split())
    assert "First difference: tick 30 at 3.00 s, blue_1, safety_margin_m" in text


def test_a_cut_log_is_proved_as_far_as_it_goes(folder):
    result = run(folder / "cut.mcap")
    assert result.exit_code == 0
    assert "not closed" in result.output
    assert "not as it was written" not in result.output
    assert "the same bit for bit" in result.output


def test_a_cut_log_is_mended(folder, tmp_path):
    result = run(folder / "cut.mcap", "--mend", tmp_path / "mended.mcap")
    assert result.exit_code == 0, result.output
    again = run(tmp_path / "mended.mcap")
    assert again.exit_code == 0
    assert "not closed" not in again.output
    assert "cut off (crash, power or kill) and mended" in again.output


def test_without_the_shield_with_everything_written(folder, tmp_path):
    files = {name: tmp_path / f"out.{name}" for name in ("html", "npz", "json")}
    options = ["--html", files["html"], "--record", files["npz"], "--json", files["json"]]
    result = run(folder / "sound.mcap", "--without-shield", *options)
    assert result.exit_code == 0, result.output
    content = json.loads(files["json"].read_text())
    assert undocumented(content, KEYS["replay"]) == []
    assert content["sides"]["with"]["breaches_opponent"] == content["sides"]["with"]["breaches_teammate"] == 0
    assert sum(content["sides"]["without"][f"breaches_{kind}"] for kind in ("opponent", "teammate")) > 0
    assert content["sides"]["without"]["closest_opponent_m"] < 2.5 < content["sides"]["with"]["closest_opponent_m"]
    assert content["stretches"] > 0
    assert content["different"] == 0
    assert content["files"] == [str(files["html"]), str(files["npz"])]
    page = files["html"].read_text()
    assert "as it was" in page
    assert "without the shield" in page
    assert load(files["npz"])["position"].shape == (STEPS, 4, 2)
    assert "closest teammate" in result.output


def test_breaches_that_happened_get_verdicts(folder, tmp_path):
    result = run(folder / "crash.mcap", "--without-shield", "--json", tmp_path / "out.json")
    assert result.exit_code == 0, result.output
    content = json.loads((tmp_path / "out.json").read_text())
    assert undocumented(content, KEYS["replay"]) == []
    verdicts = [breach["verdict"] for breach in content["sides"]["with"]["breaches"]]
    assert verdicts
    assert set(verdicts) == {"avoidable"}
    assert "Breaches that happened" in result.output
    assert "avoidable" in result.output


def test_verdicts_can_be_left_out(folder, tmp_path):
    result = run(folder / "crash.mcap", "--without-shield", "--no-judge", "--json", tmp_path / "out.json")
    content = json.loads((tmp_path / "out.json").read_text())
    assert result.exit_code == 0
    assert {breach["verdict"] for breach in content["sides"]["with"]["breaches"]} == {"not_judged"}


@pytest.mark.parametrize(
    ("content", "words"),
    [(None, "cannot open"), (b"not a log", "holds no header of a steerclear log"), (b"", "holds no header")],
)
def test_bad_input_is_one_line_and_2(tmp_path, content, words):
    path = tmp_path / "x.mcap"
    if content is not None:
        path.write_bytes(content)
    result = run(path)
    assert result.exit_code == 2
    assert words in " ".join(result.output.split())


def test_a_log_without_a_decision_says_so(tmp_path):
    write_log(tmp_path / "x.mcap", 3, edit=lambda tick: dataclasses.replace(tick, fleet=None, decisions=None))
    result = run(tmp_path / "x.mcap")
    assert result.exit_code == 3
    assert "no decision of the shield: nothing is proved" in result.output
    assert run(tmp_path / "x.mcap", "--without-shield").exit_code == 2


def test_the_tests_encounter_is_one(folder):
    """Otherwise these tests prove nothing."""
    assert any(tick.decisions.intervened.any() for tick in Encounter(header_of(ShieldConfig()), STEPS))
