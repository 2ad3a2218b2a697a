"""What the scripts of this folder share: they run inside a virtual environment that has Mitsuba."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "scripts"))
from python_environment import InstallationFailed, choose_mitsuba_variant, mitsuba_environment  # noqa: E402, F401


def enter_environment(script: str) -> None:
    """Replaces this process by one in a virtual environment that has Mitsuba, made on the first call."""
    try:
        python = mitsuba_environment()
    except InstallationFailed as error:
        sys.exit(f"error: {error}")
    if Path(sys.prefix) != python.parent.parent:
        os.execv(python, [str(python), os.path.abspath(script), *sys.argv[1:]])
