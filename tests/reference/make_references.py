#!/usr/bin/env python3
"""Renders the reference images of the Cornell box with Mitsuba 3 (see README.md here, and `make references`).

Per number of bounces two images of 32x32 pixels are written, each pixel the mean of a tile of 8x8 pixels of the
256x256 rendering: `cornell_bounces_N.exr` holds everything, `cornell_reflected_N.exr` everything but the light that
comes from the lamp straight into the camera. Channels R, G, B are means over independent seeds, varR, varG, varB the
variances of these means (sample variance over the seeds, divided by their number).

The script starts itself again inside a virtual environment with Mitsuba from PyPI.
"""

import argparse
import sys
import time
import zlib
from pathlib import Path

from mitsuba_process import choose_mitsuba_variant, enter_environment

RESOLUTION = 256
TILE = 8
NO_ROULETTE = 1 << 20
# bounces -> (seeds, samples a pixel and seed). None is unlimited, ended by Mitsuba's unbiased roulette.
PLAN = {0: (64, 256), 1: (64, 64), 2: (64, 64), 7: (64, 64), None: (64, 64)}


def integrator(mi, bounces):
    """Mitsuba counts path edges (max_depth), Sunfleck scattering events: one less."""
    if bounces is None:
        return mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": 5})
    return mi.load_dict({"type": "path", "max_depth": bounces + 1, "rr_depth": NO_ROULETTE})


def scene(mi):
    description = mi.cornell_box()
    sensor = description["sensor"]
    sensor["film"] = {"type": "hdrfilm", "width": RESOLUTION, "height": RESOLUTION, "rfilter": {"type": "box"},
                      "pixel_format": "rgb", "component_format": "float32"}
    sensor["sampler"] = {"type": "independent", "sample_count": 1}
    return mi.load_dict(description)


def tile_means(numpy, image):
    tiles = RESOLUTION // TILE
    return image.astype(numpy.float64).reshape(tiles, TILE, tiles, TILE, 3).mean(axis=(1, 3))


class Accumulator:
    """Mean and variance of the mean over seeds (Welford 1962), for every tile and for the whole image."""

    def __init__(self, numpy):
        self.numpy, self.count, self.mean, self.sum_of_squares = numpy, 0, 0.0, 0.0

    def add(self, tiles):
        self.count += 1
        delta = tiles - self.mean
        self.mean = self.mean + delta / self.count
        self.sum_of_squares = self.sum_of_squares + delta * (tiles - self.mean)

    def variance_of_mean(self):
        return self.sum_of_squares / (self.count - 1) / self.count

    def write(self, mi, path: Path, spp: int, integrator_text: str) -> None:
        channels = self.numpy.concatenate([self.mean, self.variance_of_mean()], axis=2).astype(self.numpy.float32)
        bitmap = mi.Bitmap(channels, pixel_format=mi.Bitmap.PixelFormat.MultiChannel,
                           channel_names=["R", "G", "B", "varR", "varG", "varB"])
        metadata = bitmap.metadata()
        metadata["seeds"] = str(self.count)
        metadata["samples_per_pixel_and_seed"] = str(spp)
        metadata["renderer"] = f"Mitsuba {mi.__version__} {mi.variant()}"
        metadata["integrator"] = integrator_text
        bitmap.write(str(path))

    def row(self, name: str) -> str:
        """A row of the README's table: the image's means, their standard errors, the tiles' relative errors."""
        numpy = self.numpy
        variance = self.variance_of_mean()
        mean = self.mean.mean(axis=(0, 1))
        error = numpy.sqrt(variance.sum(axis=(0, 1))) / (variance.shape[0] * variance.shape[1])
        lit = self.mean > 1e-3 * mean
        relative = numpy.sqrt(variance[lit]) / self.mean[lit]
        means = " | ".join(f"{m:.6f} ± {e:.6f}" for m, e in zip(mean, error))
        return (f"| `{name}` | {means} | {100 * (error / mean).max():.4f} % | "
                f"{100 * numpy.median(relative):.2f} % | {100 * relative.max():.2f} % |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).resolve().parent, help="where the EXRs go")
    parser.add_argument("--only", help="one number of bounces, or 'unlimited'")
    parser.add_argument("--seeds", type=int, help="seeds for each image, instead of the plan's")
    parser.add_argument("--spp", type=int, help="samples a pixel and seed, instead of the plan's")
    arguments = parser.parse_args()
    enter_environment(__file__)

    import mitsuba as mi
    import numpy

    mi.set_variant(choose_mitsuba_variant(mi))
    print(f"Mitsuba {mi.__version__}, {mi.variant()}", file=sys.stderr)
    box = scene(mi)
    emitted_only = integrator(mi, 0)
    for bounces, (seeds, spp) in PLAN.items():
        label = "unlimited" if bounces is None else str(bounces)
        if arguments.only not in (None, label):
            continue
        seeds, spp = arguments.seeds or seeds, arguments.spp or spp
        kernel = integrator(mi, bounces)
        text = str(kernel).replace("\n", " ")
        everything, reflected = Accumulator(numpy), Accumulator(numpy)
        start = time.monotonic()
        for index in range(seeds):
            # Different seeds for different images, so that they are independent of one another as well.
            seed = zlib.crc32(f"sunfleck {label} {index}".encode())
            image = numpy.array(mi.render(box, integrator=kernel, spp=spp, seed=seed))
            everything.add(tile_means(numpy, image))
            if bounces != 0:
                # The position in the pixel is the first number that a sample draws, so the same seed shows the same
                # lamp pixels: the difference is what was scattered, without the noise of the lamp's edge.
                lamp = numpy.array(mi.render(box, integrator=emitted_only, spp=spp, seed=seed))
                difference = image - lamp
                if difference.min() < -1e-3 * image.max():
                    sys.exit("the two renderings of one seed do not share their camera rays; the difference is invalid")
                reflected.add(tile_means(numpy, difference))
        everything.write(mi, arguments.out / f"cornell_bounces_{label}.exr", spp, text)
        print(everything.row(f"cornell_bounces_{label}.exr"))
        if bounces != 0:
            reflected.write(mi, arguments.out / f"cornell_reflected_{label}.exr", spp, text)
            print(reflected.row(f"cornell_reflected_{label}.exr"))
        sys.stdout.flush()
        print(f"{label}: {seeds} seeds x {spp} samples a pixel, {time.monotonic() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    main()
