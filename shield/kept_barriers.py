"""The registered barriers that a shield keeps, as compiled code takes them, renewed before every decision."""

from __future__ import annotations

import numpy as np

from .backup.paths import SAG_M
from .barriers.pointer import address_of
from .barriers.registry import MOST_VALUES, get_barrier
from .config import ShieldConfig
from .hints import say_once
from .scene import Registered
from .shared import share
from .surroundings import off_m
from .tracking.tracks import steps_of_delay


class KeptBarriers:
    """Barriers by the names in `ShieldConfig.barriers`.

    Raises:
        ConfigError: there is none of that name in this process.
    """

    def __init__(self, config: ShieldConfig) -> None:
        self.names, k = config.barriers, len(config.barriers)
        for name in self.names:
            address_of(get_barrier(name))  # compiled now, not in the first decision
        self.arrays = share(
            Registered(
                address=np.zeros(k, np.int64),
                values=np.full((k, MOST_VALUES), np.nan),
                size=np.full(k, -1),
                faults=np.zeros(k, np.int64),
                off_m=float(off_m(config)) + SAG_M,
                late_s=float(steps_of_delay(config) * config.dt_s),
            )
        )

    def renew(self) -> None:
        """Write what the barriers are given now; of one that cannot say it, nothing is known. Addresses, too.

        A copy in another process has its barriers elsewhere.
        """
        if not self.names:
            return
        arrays = self.arrays
        for b, name in enumerate(self.names):
            barrier = get_barrier(name)
            arrays.address[b], arrays.faults[b], arrays.values[b] = address_of(barrier), 0, np.nan
            try:
                values = barrier.now()
            except Exception as error:  # foreign code may raise anything
                say_once(f"values of {name}", f"barrier {name!r} counts as broken: it has no values now ({error})")
                arrays.size[b] = -1
            else:
                arrays.size[b] = len(values)
                arrays.values[b, : len(values)] = values

    def tell(self) -> None:
        """Log, once for each, which barriers gave no usable margin in the last decision."""
        if not self.names:
            return
        for name, faults in zip(self.names, self.arrays.faults, strict=True):
            if faults:
                say_once(
                    f"margin of {name}",
                    f"barrier {name!r} gave no usable margin ({faults} times in one decision): NaN, an error, or a "
                    "slope beyond 10 m per m; boats keep out of there, and stop where it is so. Find out why by "
                    "check_barrier of steerclear.experiments.conformance",
                )
