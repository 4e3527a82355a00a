"""Measuring speed and memory, as ratios within one run; ``steerclear bench`` shows the results."""
