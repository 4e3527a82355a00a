"""``steerclear`` with a shield nobody heeds, for comparison on simulated boats alone. Takes its command line."""

import dataclasses

from steerclear.experiments.cli import main
from steerclear.shield import Shield
from steerclear.shield.bridge import control_loop


class Unheeded(Shield):
    """Decides, and sends what was wanted."""

    def decide(self, fleet, wanted, surroundings=None):
        return dataclasses.replace(super().decide(fleet, wanted, surroundings), filtered=wanted)


if __name__ == "__main__":
    control_loop.Shield = Unheeded
    main()
