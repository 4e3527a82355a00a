"""The oracle must not share code with what it judges."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest
from steerclear.experiments import oracle

FILES = sorted(Path(oracle.__file__).parent.glob("*.py"))
ALLOWED = {"__future__", "contextlib", "numpy", "numba", "math", "dataclasses", "enum", "typing", "collections",
           "functools", "hashlib", "itertools", "logging", "pathlib"}  # fmt: skip
BLOCKED = """
import sys
class Wall:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[:2] in (["steerclear", "shield"], ["steerclear", "env"], ["steerclear", "policies"]):
            raise ImportError("blocked: " + name)
sys.meta_path.insert(0, Wall())
import numpy as np
from steerclear.experiments.oracle import Boat, judge
rows = np.zeros((60, 2, 11))
rows[:, 0, 1] = np.arange(60) * 0.3
rows[:, 0, 3] = 3.0
rows[:, 1, 1] = 10.0
own = Boat("single_integrator", 10.0, max_turn_dps=90.0)
print(judge(rows, [own, own], 0, 25, 2.5).outcome, *(n for n in sys.modules if n.startswith("steerclear.shield")))
"""


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_imports_nothing_of_ours_from_outside(file):
    for node in ast.walk(ast.parse(file.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level <= 1, f"line {node.lineno} reaches out of the folder"
            names = [] if node.level else [node.module or ""]
        assert {name.split(".")[0] for name in names} <= ALLOWED


def test_judges_where_the_shield_cannot_be_imported():
    done = subprocess.run([sys.executable, "-c", BLOCKED], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["avoidable"]
