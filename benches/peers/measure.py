"""Statistics of the comparison: errors against a reference with its own variance taken out, equality, fits."""

import math

import numpy

# relMSE divides by reference² + EPSILON²; `sunfleck compare` uses the same.
EPSILON = 0.01
TILE = 16


class Reference:
    """The mean of independent long renderings of one renderer; their spread gives what it is still worth."""

    def __init__(self, parts):
        parts = numpy.asarray(parts, numpy.float64)
        self.count = len(parts)
        self.mean = parts.mean(axis=0)
        self.variance = parts.var(axis=0, ddof=1) / self.count
        self.image_means = parts.mean(axis=(1, 2))  # count × 3
        size = parts.shape[1] // TILE
        self.tiles = parts.reshape(self.count, size, TILE, size, TILE, 3).mean(axis=(2, 4)).reshape(self.count, -1)


def errors(image, reference) -> dict:
    """MSE and relMSE over pixels and channels. The reference's own variance is what it adds to both; it is subtracted."""
    square = (image.astype(numpy.float64) - reference.mean) ** 2 - reference.variance
    return {"mse": float(square.mean()), "relmse": float((square / (reference.mean**2 + EPSILON**2)).mean())}


def equality(a, b, level=0.01) -> dict:
    """Whole-image means with standard errors, and Welch's t-test of every tile and channel (Šidák over all of them)."""
    from scipy import stats

    mean_a, mean_b = a.image_means.mean(axis=0), b.image_means.mean(axis=0)
    error = numpy.sqrt(a.image_means.var(axis=0, ddof=1) / a.count + b.image_means.var(axis=0, ddof=1) / b.count)
    lit = (a.tiles.std(axis=0) > 0) & (b.tiles.std(axis=0) > 0)
    p = stats.ttest_ind(a.tiles[:, lit], b.tiles[:, lit], axis=0, equal_var=False).pvalue
    threshold = 1 - (1 - level) ** (1 / max(1, len(p)))
    relative = (mean_a - mean_b) / mean_b
    tile_a, tile_b = a.tiles.mean(axis=0)[lit], b.tiles.mean(axis=0)[lit]
    return {
        "relative_difference": relative.tolist(), "relative_standard_error": (error / mean_b).tolist(),
        "tiles": int(len(p)), "tiles_that_differ": int((p < threshold).sum()), "smallest_p": float(p.min()),
        "median_tile_difference": float(numpy.median(numpy.abs(tile_a - tile_b) / tile_b)),
    }


def fit(seconds, error) -> tuple[float, float]:
    """Slope and intercept of log(error) over log(seconds), by least squares."""
    keep = numpy.asarray(error) > 0
    slope, intercept = numpy.polyfit(numpy.log(numpy.asarray(seconds)[keep]), numpy.log(numpy.asarray(error)[keep]), 1)
    return float(slope), float(intercept)


def time_to(error: float, line: tuple[float, float]) -> float:
    slope, intercept = line
    return math.exp((math.log(error) - intercept) / slope)
