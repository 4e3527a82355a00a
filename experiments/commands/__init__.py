"""The commands of ``steerclear``, one module each; `steerclear.experiments.cli` puts them together."""
