"""A command needs a folder to stand in: imported first, since much of what commands import cannot be without one."""

from __future__ import annotations

import os
import sys

try:
    os.getcwd()
except OSError as error:
    sys.stderr.write(f"error: the present folder is gone ({error.strerror}); change to another: cd\n")
    sys.exit(2)
