"""What the help of each command ends with, and which options it leaves to ``--help-all``."""

from __future__ import annotations

MANY_OPTIONS = 13
"""A command with more options leaves those of `RARE` out of ``--help``, which then fits one screen."""

RARE = {
    *("--set", "--shield-set", "--profile", "--fixed-start", "--penalty", "--trust"),
    *("--answer-time", "--delay", "--noise", "--current", "--judge", "--no-judge", "--no-shield-autopilot"),
    *("--engine", "--address", "--also", "--scene"),
    *("--restarts", "--population", "--generations", "--attackers", "--no-tlog", "--wait"),
    *("--wind", "--loss", "--jitter", "--boot", "--really", "--off", "--with-parent", "--allow-remote"),
    *("--no-wait", "--random-start", "--max-time"),
}
"""Options that few need, of whatever command has them."""

EXAMPLES = {
    "ablate": "steerclear ablate --preset mctf2025 --games 20 --out results/mine",
    "attack": "steerclear attack --platform heron --attackers 2 --out results/attack",
    "bench": "steerclear bench --quick",
    "compare": "steerclear compare results/before results/after",
    "deploy": "steerclear deploy --demo --policy medium",
    "docs": "steerclear docs results/mine --out docs/studies",
    "encounters": "steerclear encounters --family rammer_1 --n 100 --guard none,shield",
    "entry check": "steerclear entry check my_entry.zip",
    "entry report": "steerclear entry report my_entry.zip --quick",
    "entry wrap": "steerclear entry wrap my_entry.zip --out shielded.zip",
    "evaluate": "steerclear evaluate my_entry.zip --preset mctf2026 --games 20",
    "export": "steerclear export model.zip --out weights.npz",
    "fit": "steerclear fit logs/sea_trial.mcap --boat blue_1",
    "parity": "steerclear parity recorded_game.npz",
    "platform check": "steerclear platform check my_boat.yaml",
    "platform new": "steerclear platform new my_boat --from heron",
    "platform show": "steerclear platform show heron",
    "play": "steerclear play --own medium --opponent hidden --save game.html",
    "preflight": "steerclear preflight FLEET.yaml --no-drill",
    "reach check": "steerclear reach check table.npz",
    "reach compare": "steerclear reach compare --own heron --other heron",
    "reach play": "steerclear reach play --own surveyor --other heron",
    "reach show": "steerclear reach show --own heron --other heron",
    "reach solve": "steerclear reach solve --own my_boat.yaml --other heron --quick",
    "referee": "steerclear referee FLEET.yaml",
    "render": "steerclear render game.npz --to game.mp4",
    "replay": "steerclear replay logs/run.mcap --html run.html",
    "sea-trial": "steerclear sea-trial FLEET.yaml --only blue_1",
    "sim-boats": "steerclear sim-boats --demo --duration 120",
    "tournament": "steerclear tournament --teams lucas,chao,mine.zip --quick",
    "train": "steerclear train my_training.yaml --out results/training",
    "train-study": "steerclear train-study my_study.yaml --out results/study",
    "warm-up": "steerclear warm-up",
}
"""By the command's name, what somebody would type."""
