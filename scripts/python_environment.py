"""Virtual environments for the programs that Sunfleck is compared with: one a program, under ~/.cache/sunfleck.

Used by tests/reference/make_references.py and by benches/peers: both want Mitsuba, and nobody wants it installed twice.
"""

import glob
import os
import shutil
import subprocess
import sys
from pathlib import Path

MITSUBA = "3.9.1"


class InstallationFailed(Exception):
    """A package could not be installed here; the message says which, and what pip said."""


def environment_folder(name: str) -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(base) / "sunfleck" / name


def environment(name: str, packages: list[str], python: str | None = None) -> Path:
    """The interpreter of the virtual environment `name`, which is made on the first call.

    `python` names the interpreter that it needs ("python3.11"), where the packages exist for one version alone.
    The file `complete` is written last, so an installation that was cut off is done again.
    """
    folder = environment_folder(name)
    interpreter = folder / "bin" / "python"
    marker, wanted = folder / "complete", "\n".join(packages) + "\n"
    if marker.exists() and marker.read_text() in ("", wanted):
        return interpreter
    base = sys.executable if python is None else shutil.which(python)
    if base is None:
        raise InstallationFailed(f"{name}: needs {python}, which is not in the path")
    print(f"installing {' '.join(packages)} from PyPI into {folder}", file=sys.stderr)
    for command in ([base, "-m", "venv", str(folder)],
                    [str(interpreter), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *packages]):
        try:
            done = subprocess.run(command, capture_output=True, text=True)
        except OSError as error:
            raise InstallationFailed(f"{name}: {error}") from error
        if done.returncode != 0:
            raise InstallationFailed(f"{name}: {' '.join(command[1:])} failed: {(done.stderr or done.stdout)[-400:]}")
    marker.write_text(wanted)
    return interpreter


def mitsuba_environment() -> Path:
    return environment(f"mitsuba-{MITSUBA}", [f"mitsuba=={MITSUBA}", "numpy"])


def choose_mitsuba_variant(mi) -> str:
    """llvm_ad_rgb where a recent LLVM is found (older ones crash on recent processors), else the slow scalar_rgb. With
    SUNFLECK_PEERS_GPU=1 cuda_ad_rgb before both, if there is CUDA."""
    if os.environ.get("SUNFLECK_PEERS_GPU") == "1" and "cuda_ad_rgb" in mi.variants():
        import drjit

        if drjit.has_backend(drjit.JitBackend.CUDA):
            return "cuda_ad_rgb"
    if "DRJIT_LIBLLVM_PATH" not in os.environ:
        found = sorted(glob.glob("/usr/lib/*-linux-gnu/libLLVM.so.*") + glob.glob("/usr/lib/llvm-*/lib/libLLVM.so.*"))
        recent = [path for path in found if path.split(".so.")[1].split(".")[0].isdigit()
                  and int(path.split(".so.")[1].split(".")[0]) >= 19]
        if recent:
            os.environ["DRJIT_LIBLLVM_PATH"] = recent[-1]
    if "DRJIT_LIBLLVM_PATH" in os.environ and "llvm_ad_rgb" in mi.variants():
        return "llvm_ad_rgb"
    print("no LLVM 19 or newer (Debian: libllvm19): falling back to scalar_rgb, which is slow", file=sys.stderr)
    return "scalar_rgb"
