"""Every command of the page "from your boat to a shielded boat", as it stands there, on simulated boats."""

import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from steerclear.experiments.cli import app
from steerclear.experiments.deploy.demo import free_ports
from steerclear.shield.platforms.files import load_platform
from typer.testing import CliRunner

PAGE = Path(__file__).parents[2] / "docs" / "your_boat.md"
SPEED = "3"
FLEET = """
version: 1
team: blue
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [160, 80]}
geofence: {xmin_m: -40, ymin_m: -40, xmax_m: 200, ymax_m: 120}
boats:
  - name: blue_1
    agent: agent_0
    platform: my_boat.yaml
    link: {kind: mavlink, address: "udpin:127.0.0.1:PORT0", system_id: 1}
  - {name: red_1, agent: agent_1, platform: heron, contact: feed}
feed: {listen: "127.0.0.1:PORT1"}
"""
QUICK = ("platform", "fit")
"""Commands that open no socket."""


def commands(kind=""):
    """The page's commands, in its order."""
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(), flags=re.M | re.S)
    return [
        shlex.split(line)
        for name, block in blocks
        if name == kind
        for line in block.splitlines()
        if line.startswith("steerclear")
    ]


def write_fleet(folder):
    text = FLEET
    for k, port in enumerate(free_ports(2)):
        text = text.replace(f"PORT{k}", str(port))
    (folder / "FLEET.yaml").write_text(text)


def test_the_page_shows_each_step_and_all_of_them_exist():
    named = [words[1] for words in commands()]
    assert named == ["platform"] * 3 + ["sea-trial", "fit", "platform", "preflight", "deploy", "replay"]
    for words in commands() + commands("sim"):
        command = words[1 : 3 if words[1] == "platform" else 2]
        result = CliRunner().invoke(app, [*command, "--help"])
        assert result.exit_code == 0, words
        options = [word for word in words if word.startswith("--")]
        assert all(option in result.output for option in options), words


def test_the_first_description_is_one_that_the_shield_takes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in commands()[:3]:
        result = CliRunner().invoke(app, words[1:])
        assert result.exit_code == 0, (words, result.output)
    assert load_platform("my_boat.yaml").platform.name == "my_boat"
    assert "turns 90 deg" in result.output


@pytest.mark.study
def test_the_whole_page_on_a_boat_that_is_not_what_it_was_said_to_be(tmp_path):
    """Sim-boats at some times real time; the fit must foretell the true boat to half a metre at 3 s."""
    write_fleet(tmp_path)
    environment = {**os.environ, "COLUMNS": "200"}
    program = [sys.executable, "-m", "steerclear.experiments.cli"]

    def run(words, *more):
        arguments = [str(path) for word in words[1:] for path in (sorted(tmp_path.glob(word)) or [word])]
        done = subprocess.run(
            [*program, *arguments, *more], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=1500
        )
        assert done.returncode == 0, (words, done.stdout[-3000:], done.stderr[-3000:])
        return done.stdout

    page, (sim,) = commands(), commands("sim")
    for words in page[:3]:
        run(words)
    with (tmp_path / "boats.txt").open("wb") as said:
        boats = subprocess.Popen(
            [*program, *sim[1:], "--speed", SPEED, "--no-wait"], cwd=tmp_path, stdout=said, stderr=said
        )
    try:
        for words in page[3:]:
            timed = ["--speed", SPEED, "--wait", "240"] if words[1] in ("sea-trial", "preflight", "deploy") else []
            if words[1] in ("preflight", "deploy", "sea-trial"):
                timed += ["--accept", "latency", "--accept", "rates", "--accept", "spread"]
            if words[1] == "fit":
                words = [*words[:2], str(max((tmp_path / "logs").glob("*.mcap"))), *words[3:]]
            run(words, *timed)
            if words[1] == "fit":
                assert load_platform(tmp_path / "my_boat.yaml").measured["median_3_s_m"] < 0.5
    finally:
        boats.send_signal(signal.SIGTERM)
        boats.wait(60)
