#!/usr/bin/env python3
"""Renders the gallery of other people's models (`make gallery MODELS=FOLDER`; docs/gallery/README.md).

FOLDER holds the models, which are no part of the repository; docs/gallery/models.json lists them, each with what its
author says it shows and what Sunfleck's image shows. A model that is missing or fails is named, the rest is rendered,
and the exit code is 1. A model that is `refused` in the list must be refused.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(REPOSITORY / "scripts"))
from gallery_page import write_page  # noqa: E402
from python_environment import InstallationFailed, environment  # noqa: E402
from staged_copy import CAMERA, staged_copy  # noqa: E402

GALLERY = REPOSITORY / "docs" / "gallery"
PILLOW = "pillow==11.3.0"
JPEG_QUALITY = 85
# Pixels: most models, and those whose labels have to be read ("large": true).
SIZE, LARGE_SIZE = (256, 192), (400, 300)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path, help="the folder of the models; paths in the list are relative to it")
    parser.add_argument("--only", help="names with commas; all without it")
    parser.add_argument("--spp", type=int, help="samples per pixel, in place of what the list says")
    parser.add_argument("--program", type=Path, default=REPOSITORY / "target" / "release" / "sunfleck")
    parser.add_argument("--out", type=Path, default=GALLERY, help="where the images and README.md go [docs/gallery]")
    parser.add_argument("--page", action="store_true", help="renders nothing, writes README.md from the list alone")
    return parser.parse_args()


def enter_environment() -> None:
    """Starts this script again in the virtual environment that has Pillow, which writes the JPEGs."""
    try:
        python = environment("gallery", [PILLOW])
    except InstallationFailed as failure:
        sys.exit(f"gallery: {failure}")
    if Path(sys.prefix) != python.parent.parent:
        os.execv(python, [str(python), *sys.argv])


def save_jpeg(png: Path, jpeg: Path) -> None:
    from PIL import Image

    with Image.open(png) as image:
        image.convert("RGB").save(jpeg, quality=JPEG_QUALITY, optimize=True)


def command(model: dict, scene: Path, png: Path, options, table: dict) -> list[str]:
    width, height = LARGE_SIZE if model.get("large") else SIZE
    line = [str(options.program), "render", str(scene), "-o", str(png), "--resolution", f"{width}x{height}",
            "--spp", str(options.spp or model.get("spp", table["spp"])), "--strict", "--json", "--quiet"]
    lighting = model.get("environment", table["environment"])
    if lighting is not None:
        line += ["--env", str(options.folder / lighting)]
    if "yfov" in model:
        line += ["--camera", CAMERA]
    return line + model.get("flags", [])


def stage(model: dict, path: Path, scratch: Path, program: Path) -> Path:
    """The file itself, or a copy where the list asks for another side or field of view."""
    if not {"turn", "facing", "yfov"} & model.keys():
        return path
    return staged_copy(path, scratch, program, model)


def render(model: dict, options, table: dict) -> str | None:
    """Renders one model to OUT/NAME.jpg; returns what went wrong, or None."""
    path = options.folder / model["file"]
    if not path.is_file():
        return f"{path} is missing"
    with tempfile.TemporaryDirectory() as scratch:
        png = Path(scratch) / "image.png"
        try:
            scene = stage(model, path, Path(scratch), options.program)
        except (OSError, ValueError, KeyError) as error:
            return f"{path}: {error!r}"
        done = subprocess.run(command(model, scene, png, options, table), capture_output=True, text=True)
        if model.get("refused"):
            return None if done.returncode == 3 else f"exit code {done.returncode}, where 3 (refused) is expected"
        if done.returncode != 0:
            return f"exit code {done.returncode}: {done.stderr.strip()[-400:]}"
        save_jpeg(png, options.out / f"{model['name']}.jpg")
        model["warnings"] = json.loads(done.stdout)["warnings"]
    return None


def main() -> int:
    options = arguments()
    table = json.loads((GALLERY / "models.json").read_text())
    names = options.only.split(",") if options.only else [model["name"] for model in table["models"]]
    unknown = set(names) - {model["name"] for model in table["models"]}
    if unknown:
        sys.exit(f"gallery: {', '.join(sorted(unknown))}: not in {GALLERY / 'models.json'}")
    if not options.folder.is_dir():
        sys.exit(f"gallery: {options.folder} is no folder")
    if not options.program.is_file():
        sys.exit(f"gallery: {options.program} is missing; run `make build`, or give --program")
    options.out.mkdir(parents=True, exist_ok=True)
    failures = []
    if not options.page:
        enter_environment()
        for model in (model for model in table["models"] if model["name"] in names):
            begin = time.monotonic()
            failure = render(model, options, table)
            outcome = failure or "; ".join(["done", *model.get("warnings", [])])
            print(f"{model['name']}: {outcome} ({time.monotonic() - begin:.0f} s)", file=sys.stderr)
            if failure:
                failures.append(model["name"])
    write_page(table, options.out)
    if failures:
        print(f"gallery: {len(failures)} of {len(names)} models failed: {', '.join(failures)}", file=sys.stderr)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
