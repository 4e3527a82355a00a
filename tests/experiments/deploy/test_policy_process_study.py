"""How long the loop's two calls take whatever the policy does; needs a machine that has nothing else to do.

``pytest -m study -s tests/experiments/deploy/test_policy_process_study.py``
"""

import sys
import time

import numpy as np
import pytest
from steerclear.env.mctf import MctfEnv
from steerclear.experiments.deploy.player import cast_of
from steerclear.experiments.deploy.policy_process import PolicyProcess

TURN_S = 0.05
POLICIES = {
    "answers": "return 4",
    "hangs": "self.n += 1\nwhile self.n > 60: pass\nreturn 4",
    "dies": "import os\nself.n += 1\nif self.n > 60: os._exit(1)\nreturn 4",
    "floods": "print('x' * 100_000)\nreturn 4",
    "not finite": "return (float('nan'), 1e9)",
}


@pytest.mark.study
@pytest.mark.parametrize("kind", POLICIES)
def test_a_turn_never_waits_for_the_policy(fleet_of, snapshot_of, write_entry, kind):
    fleet = fleet_of()
    env = MctfEnv(cast_of(fleet).config)
    env.reset(seed=1)
    spent_s, ages_s = [], []
    with PolicyProcess(fleet, write_entry(POLICIES[kind], start="self.n = 0"), 0.5) as process:
        process.start()
        begun_s = due_s = time.monotonic()
        while due_s - begun_s < 15.0:
            snapshot = snapshot_of(env, fleet, len(spent_s), time.monotonic())
            began_s = time.perf_counter()
            process.offer(snapshot)
            answer = process.latest()
            spent_s.append(time.perf_counter() - began_s)
            ages_s.append(answer.age_s)
            due_s += TURN_S
            time.sleep(max(0.0, due_s - time.monotonic()))
        restarts = process.restarts
    p50, p99, longest = 1e3 * np.quantile(spent_s, [0.5, 0.99, 1.0])
    sys.stdout.write(
        f"\n{kind}: turn {p50:.2f} ms, 99 of 100 within {p99:.1f}, longest {longest:.1f}; age of the answer "
        f"{np.median(ages_s):.3f} s; started again {restarts} times\n"
    )
    assert p99 < 10.0
    assert longest < 50.0
    assert (restarts > 0) == (kind in ("hangs", "dies"))
