"""Follows the page "from your boat to a shielded boat" as it stands there, on a simulated boat."""

import os
import re
import shlex
import signal
import subprocess
import sys
from pathlib import Path

from steerclear.experiments.deploy.demo import free_ports

PAGE = Path(__file__).parents[1] / "docs" / "your_boat.md"
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
DRIVES = ("sea-trial", "preflight", "deploy")
"""Commands that steer boats; simulated ones may be faster than the clock, on a machine that others use."""
DRIVEN = ["--speed", SPEED, "--wait", "240", "--accept", "latency", "--accept", "rates", "--accept", "spread"]
PROGRAM = [sys.executable, "-m", "steerclear.experiments.cli"]


def commands(kind=""):
    """The page's commands, in its order."""
    return [words for words in lines(kind) if words[0] == "steerclear"]


def lines(kind=""):
    """The page's commands, and files that it moves."""
    blocks = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE.read_text(), flags=re.M | re.S)
    return [
        shlex.split(line)
        for name, block in blocks
        if name == kind
        for line in block.splitlines()
        if line.startswith(("steerclear ", "mv "))
    ]


def follow(folder, last=""):
    """Give the page's commands in that folder until the one named ``last`` is done, all of them if it is empty."""
    text = FLEET
    for k, port in enumerate(free_ports(2)):
        text = text.replace(f"PORT{k}", str(port))
    (folder / "FLEET.yaml").write_text(text)
    page, (sim,) = lines(), commands("sim")
    boats = None
    try:
        for words in page:
            if words[0] == "mv":
                (folder / words[1]).rename(folder / words[2])
                continue
            if words[1] in DRIVES and boats is None:
                with (folder / "boats.txt").open("wb") as said:
                    program = [*PROGRAM, *sim[1:], "--speed", SPEED, "--no-wait"]
                    boats = subprocess.Popen(program, cwd=folder, stdout=said, stderr=said)
            _run(folder, words)
            if words[1] == last:
                break
    finally:
        if boats is not None:
            boats.send_signal(signal.SIGTERM)
            boats.wait(60)


def _run(folder, words):
    if any(word.endswith(".mcap") for word in words):
        log = str(max((folder / "logs").glob("*.mcap")).relative_to(folder))
        words = [log if word.endswith(".mcap") else word for word in words]
    done = subprocess.run(
        [*PROGRAM, *words[1:], *(DRIVEN if words[1] in DRIVES else [])],
        cwd=folder,
        env={**os.environ, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=1500,
    )
    assert done.returncode == 0, (words, done.stdout[-3000:], done.stderr[-3000:])
