"""Earlier name of `policies.foreign`, for one more release."""

from typing import Any

from steerclear.shield.renamed import warn

from . import foreign


def __getattr__(name: str) -> Any:
    found = getattr(foreign, name)
    if not name.startswith("__"):
        warn("steerclear.policies.guard", "steerclear.policies.foreign", stacklevel=2)
    return found
