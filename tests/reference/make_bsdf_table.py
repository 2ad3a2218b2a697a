#!/usr/bin/env python3
"""Writes mitsuba_bsdfs.json: values of Mitsuba 3's BSDFs at chosen directions (see README.md here, and `make references`).

Directions are those of Sunfleck's shading frame (+Y is the normal, both point away from the surface) and are exact in
32-bit floats. Half vectors are chosen where the lobe is, by their slope in units of its roughness.

The script starts itself again inside a virtual environment with Mitsuba from PyPI.
"""

import json
import math
from itertools import product
from pathlib import Path

from mitsuba_process import enter_environment

COLOUR = (0.9, 0.6, 0.3)
COSINES = (0.995, 0.7, 0.3, 0.06)
# Half vectors: slopes in units of the roughness, and azimuths in radians.
SLOPES = (0.2, 0.9, 3.0)
AZIMUTHS = (0.4, 1.9, 3.6)


def f32(numpy, vector):
    return numpy.float64(numpy.float32(vector))


def directions(numpy, alpha, eta=None):
    """Pairs (wo, wi), wo above the surface: reflections, or refractions into a far side of relative index eta."""
    for cosine, slope, azimuth in product(COSINES, SLOPES, AZIMUTHS):
        turn = 2.6 * cosine
        sine = math.sqrt(1 - cosine * cosine)
        wo = f32(numpy, [sine * math.cos(turn), cosine, sine * math.sin(turn)])
        h = numpy.array([slope * alpha[0] * math.cos(azimuth), 1, slope * alpha[1] * math.sin(azimuth)])
        h /= numpy.linalg.norm(h)
        c = wo @ h
        if c <= 0:
            continue
        if eta is None:
            wi = 2 * c * h - wo
        else:
            squared = 1 - (1 - c * c) / (eta * eta)
            if squared <= 0:
                continue
            wi = h * (c / eta - math.sqrt(squared)) - wo / eta
        # Closer to the horizon than this, rounding alone decides.
        if (wi[1] if eta is None else -wi[1]) > 0.01:
            yield wo, f32(numpy, wi)


def to_mitsuba(mi, w):
    return mi.ScalarVector3f(w[0], w[2], w[1])


class Tables:
    def __init__(self, mi, numpy):
        self.mi, self.numpy = mi, numpy

    def interaction(self, wo):
        # Mitsuba's wi is where the path comes from: Sunfleck's wo.
        si = self.mi.SurfaceInteraction3f()
        si.wi = to_mitsuba(self.mi, wo)
        return si

    def continuous(self, name, plugin, pairs, **parameters):
        """f without the cosine, and pdf, of (wo, wi): rows of wo, wi, f (RGB), pdf."""
        bsdf, context = self.mi.load_dict(plugin), self.mi.BSDFContext()
        rows = []
        for wo, wi in pairs:
            si, direction = self.interaction(wo), to_mitsuba(self.mi, wi)
            value = self.numpy.array(bsdf.eval(context, si, direction), self.numpy.float64).ravel() / abs(wi[1])
            rows.append([*wo, *wi, *value, float(bsdf.pdf(context, si, direction))])
        return {"name": name, "plugin": plugin["type"], **parameters, "rows": rows}

    def smooth(self, name, plugin, **parameters):
        """Delta lobes: rows of wo, probability of reflection, weight and direction of transmission (0 if there is none)."""
        bsdf, context = self.mi.load_dict(plugin), self.mi.BSDFContext()
        rows = []
        for cosine in (1.0, 0.97, 0.8, 0.6, 0.4, 0.2, 0.1, 0.01):
            sine = math.sqrt(1 - cosine * cosine)
            wo = f32(self.numpy, [sine * math.cos(cosine), cosine, sine * math.sin(cosine)])
            reflected, weight = bsdf.sample(context, self.interaction(wo), 0.0, [0.5, 0.5])
            assert reflected.wo.z > 0 and weight.x == 1, name
            row = [*wo, float(reflected.pdf), 0.0, 0.0, 0.0, 0.0]
            if reflected.pdf < 1:
                through, weight = bsdf.sample(context, self.interaction(wo), 1 - 2.0**-24, [0.5, 0.5])
                row[4:] = [float(weight.x), *(float(through.wo[k]) for k in (0, 2, 1))]
            rows.append(row)
        return {"name": name, "plugin": plugin["type"], **parameters, "rows": rows}

    def diffuse(self):
        colour = {"type": "rgb", "value": list(COLOUR)}
        pairs = list(directions(self.numpy, (0.7, 0.7)))
        return [self.continuous("diffuse", {"type": "diffuse", "reflectance": colour}, pairs, color=COLOUR)]

    def conductors(self):
        """Reflectance 1, so what is left is D and Smith's function."""
        for x, z in ((0.02, 0.02), (0.1, 0.1), (0.3, 0.3), (0.7, 0.7), (1.0, 1.0), (0.1, 0.4), (0.6, 0.15)):
            plugin = {"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha_u": x, "alpha_v": z}
            yield self.continuous(f"roughconductor {x} {z}", plugin, directions(self.numpy, (x, z)), alpha=(x, z))

    def principled(self):
        """Metals have Schlick's term with the base colour at normal incidence, dielectrics the exact one."""
        for roughness, anisotropic, metallic in ((0.3, 0.0, 1.0), (0.6, 0.0, 1.0), (0.9, 0.0, 1.0), (0.6, 0.5, 1.0),
                                                 (0.3, 0.0, 0.0), (0.7, 0.0, 0.0)):
            aspect = math.sqrt(1 - 0.9 * anisotropic)
            alpha = (roughness**2 / aspect, roughness**2 * aspect)
            colour = COLOUR if metallic else (0.0, 0.0, 0.0)
            plugin = {"type": "principled", "base_color": {"type": "rgb", "value": list(colour)}, "eta": 1.5,
                      "roughness": roughness, "anisotropic": anisotropic, "metallic": metallic}
            name = f"principled {'metal' if metallic else 'dielectric'} {roughness} {anisotropic}"
            yield self.continuous(name, plugin, directions(self.numpy, alpha), alpha=alpha, metallic=metallic,
                                  color=colour, ior=1.5)

    def thin(self):
        """The transmission of a thin sheet: a mirrored lobe whose roughness is scaled by 0.65·eta − 0.35."""
        for roughness in (0.5, 0.9):
            alpha = ((0.65 * 1.5 - 0.35) * roughness) ** 2
            plugin = {"type": "principledthin", "base_color": {"type": "rgb", "value": list(COLOUR)}, "eta": 1.5,
                      "roughness": roughness, "spec_trans": 1.0, "diff_trans": 0.0}
            pairs = [(wo, wi * [1, -1, 1]) for wo, wi in directions(self.numpy, (alpha, alpha))]
            yield self.continuous(f"principledthin {roughness}", plugin, pairs, alpha=(alpha, alpha), color=COLOUR,
                                  ior=1.5)

    def rough_dielectrics(self):
        """Reflection and transmission; eta is the index of the far side relative to that of wo's side."""
        for inside, outside in ((1.5, 1.0), (1.0, 1.5)):
            for alpha in (0.05, 0.3, 0.7):
                eta = inside / outside
                plugin = {"type": "roughdielectric", "distribution": "ggx", "alpha": alpha, "int_ior": inside,
                          "ext_ior": outside}
                pairs = [*directions(self.numpy, (alpha, alpha)), *directions(self.numpy, (alpha, alpha), eta)]
                yield self.continuous(f"roughdielectric {alpha} {eta:.4g}", plugin, pairs, alpha=(alpha, alpha), eta=eta)

    def smooth_dielectrics(self):
        for plugin in ("dielectric", "thindielectric"):
            for inside, outside in ((1.5, 1.0), (1.0, 1.5), (1.33, 1.0), (2.4, 1.0)):
                if plugin == "dielectric" or inside == 1.5:
                    yield self.smooth(f"{plugin} {inside / outside:.4g}",
                                      {"type": plugin, "int_ior": inside, "ext_ior": outside}, eta=inside / outside)

    def all(self):
        return [*self.diffuse(), *self.conductors(), *self.principled(), *self.thin(), *self.rough_dielectrics()], \
            [*self.smooth_dielectrics()]


def lines(case):
    """A case as JSON, a row a line, numbers with the nine digits that a 32-bit float needs."""
    head = json.dumps({key: value for key, value in case.items() if key != "rows"})
    rows = ",\n".join("   [" + ", ".join(f"{x:.9g}" for x in row) + "]" for row in case["rows"])
    return f"  {head[:-1]}, \"rows\": [\n{rows}]}}"


def main() -> None:
    enter_environment(__file__)
    import mitsuba as mi
    import numpy

    mi.set_variant("scalar_rgb")
    continuous, smooth = Tables(mi, numpy).all()
    columns = {"continuous": "wo.xyz, wi.xyz, f.rgb without the cosine in 1/sr, pdf per solid angle",
               "smooth": "wo.xyz, probability of reflection, weight of transmission, its direction xyz"}
    text = (f'{{"renderer": "Mitsuba {mi.__version__} {mi.variant()}",\n "columns": {json.dumps(columns)},\n'
            ' "continuous": [\n' + ",\n".join(map(lines, continuous)) + "],\n"
            ' "smooth": [\n' + ",\n".join(map(lines, smooth)) + "]}\n")
    json.loads(text)
    path = Path(__file__).resolve().parent / "mitsuba_bsdfs.json"
    path.write_text(text)
    print(f"{path.name}: {sum(len(c['rows']) for c in continuous + smooth)} rows, {len(text)} bytes")


if __name__ == "__main__":
    main()
