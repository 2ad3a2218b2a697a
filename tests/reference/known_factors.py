"""The known differences between Mitsuba's BSDFs and Sunfleck's (docs/accuracy/mitsuba-bsdfs.md), as a BSDF for Mitsuba.

It multiplies the value of a BSDF of Mitsuba's, which it contains, and leaves sampling and density as they are.
"""

import json
import math


def albedo_table(numpy, alpha, nodes=129):
    """What one scattering of GGX with correlated heights keeps, at cos θ = (i/(nodes − 1))²."""
    u, turn = [a.ravel() for a in numpy.meshgrid((numpy.arange(2048) + 0.5) / 2048, (numpy.arange(128) + 0.5) / 128)]
    tangent = alpha * numpy.sqrt(u / (1 - u))
    cosine = 1 / numpy.sqrt(1 + tangent**2)
    h = numpy.array([tangent * cosine * numpy.cos(2 * math.pi * turn), cosine, tangent * cosine * numpy.sin(2 * math.pi * turn)])
    lambda_ = lambda c: 0.5 * (numpy.sqrt(1 + alpha**2 * (1 - c * c) / (c * c)) - 1)
    values = []
    for i in range(nodes):
        c = max((i / (nodes - 1))**2, 1e-5)
        wo = numpy.array([math.sqrt(1 - c * c), c, 0])
        dot = wo @ h
        wi_y = 2 * dot * h[1] - c
        up = (dot > 0) & (wi_y > 0)
        # E = ∫ D·G₂·(wo·h)/cos θo dh, with D·cos θh dh uniform in (u, turn).
        values.append((dot[up] / (c * h[1][up]) / (1 + lambda_(c) + lambda_(wi_y[up]))).sum() / len(u))
    return values


def known_plugin(mi, dr, numpy):
    """The class `Known`: a BSDF of Mitsuba times what Sunfleck's differs by."""

    class Known(mi.BSDF):
        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.nested, self.kind, self.alpha = props["nested"], props["kind"], props["alpha"]
            self.m_components = [self.nested.flags(i) for i in range(self.nested.component_count())]
            self.m_flags = self.nested.flags()
            self.colour = mi.Color3f(*json.loads(props["colour"]))
            self.table = None if self.alpha == 0 else mi.Float(albedo_table(numpy, self.alpha))

        def kept(self, cosine):
            x = dr.sqrt(dr.maximum(cosine, 0)) * (dr.width(self.table) - 1)
            cell = mi.UInt32(dr.minimum(x, dr.width(self.table) - 2))
            low, high = dr.gather(mi.Float, self.table, cell), dr.gather(mi.Float, self.table, cell + 1)
            return dr.lerp(low, high, x - mi.Float(cell))

        def schlick(self, cosine):
            return 0.04 + 0.96 * (1 - cosine)**5

        def rough_factor(self, wi, wo):
            length = lambda w: dr.sqrt(1 + self.alpha**2 * (1 - w.z * w.z) / (w.z * w.z))
            i, o = 0.5 * (length(wi) - 1), 0.5 * (length(wo) - 1)
            smith = (1 + i) * (1 + o) / (1 + i + o)
            lost = 1 / self.kept(wi.z) - 1
            if self.kind != "dielectric":
                return smith * (1 + self.colour * lost)
            cosine = dr.dot(wi, dr.normalize(wi + wo))
            exact = mi.fresnel(cosine, 1.5)[0]
            return mi.Color3f(smith * (1 + 0.04 * lost) * self.schlick(cosine) / exact)

        def thin_factor(self, wi, wo):
            cosine = dr.abs(wi.z)
            once = mi.fresnel(cosine, 1.5)[0]
            theirs, ours = 2 * once / (1 + once), self.schlick(cosine)
            return mi.Color3f(dr.select(wi.z * wo.z > 0, ours / theirs, (1 - ours) / (1 - theirs)))

        def factor(self, wi, wo):
            if self.kind == "thin":
                return self.thin_factor(wi, wo)
            return dr.select((wi.z > 0) & (wo.z > 0), self.rough_factor(wi, wo), mi.Color3f(1.0))

        def sample(self, ctx, si, sample1, sample2, active=True):
            sample, weight = self.nested.sample(ctx, si, sample1, sample2, active)
            return sample, weight * self.factor(si.wi, sample.wo)

        def eval(self, ctx, si, wo, active=True):
            return self.nested.eval(ctx, si, wo, active) * self.factor(si.wi, wo)

        def pdf(self, ctx, si, wo, active=True):
            return self.nested.pdf(ctx, si, wo, active)

        def eval_pdf(self, ctx, si, wo, active=True):
            value, pdf = self.nested.eval_pdf(ctx, si, wo, active)
            return value * self.factor(si.wi, wo), pdf

        def traverse(self, callback):
            callback.put("nested", self.nested, mi.ParamFlags.Differentiable)

        def to_string(self):
            return f"Known[{self.kind}, {self.nested}]"

    return Known
