"""A BSDF for Mitsuba 3 that shows a packed BTF asset, in its scalar variants:

    import mitsuba as mi
    mi.set_variant("scalar_rgb")
    import mitsuba_btf                      # registers "btf"
    plane = {"type": "rectangle", "bsdf": {"type": "btf", "filename": "leaf.spmm"}}

Parameters: filename; uv_scale, repetitions of the asset a unit of the texture (1); flip_v, for meshes whose texture
coordinates Mitsuba turned upside down as it read them, which is the default for .obj (false); interpolation, "fast" or
"exact" ("fast").

A picture needs one call into Python for every light and path vertex: good for checking, not for production.
"""

import btf
import mitsuba as mi
import numpy as np

PI = np.pi


class Btf(mi.BSDF):
    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.asset = btf.open(props["filename"])
        self.scale = float(props.get("uv_scale", 1.0))
        self.flip_v = bool(props.get("flip_v", False))
        self.options = {"interpolation": str(props.get("interpolation", "fast"))}
        # All that an asset has is drawn by one strategy: lobes of any roughness, on either side.
        flags = mi.BSDFFlags.SpatiallyVarying | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        for light, eye in self.asset.meta["sides"]:
            flags |= mi.BSDFFlags.GlossyReflection if light == eye else mi.BSDFFlags.GlossyTransmission
        self.m_components = [flags]
        self.m_flags = flags

    def place(self, si):
        """Texture coordinate, v up, and the eye's direction, which Mitsuba calls wi."""
        u, v = float(si.uv[0]), float(si.uv[1])
        uv = np.array([u, 1.0 - v if self.flip_v else v]) * self.scale
        return uv, unit(si.wi)

    def evaluate(self, si, wo):
        """BRDF times cosine, which the asset's values hold times pi."""
        uv, eye = self.place(si)
        return mi.Color3f(*(self.asset.eval(uv, unit(wo), eye, **self.options) / PI).tolist())

    def density(self, si, wo):
        uv, eye = self.place(si)
        return float(self.asset.pdf(uv, unit(wo), eye, **self.options))

    def sample(self, ctx, si, sample1, sample2, active=True):
        uv, eye = self.place(si)
        at = [float(sample2[0]), float(sample2[1]), float(sample1)]
        light, density, value = self.asset.sample(uv, eye, at, **self.options)
        drawn = mi.BSDFSample3f()
        if density <= 0:
            return drawn, mi.Color3f(0.0)
        drawn.wo = mi.Vector3f(*light.tolist())
        drawn.pdf = float(density)
        drawn.eta = 1.0
        drawn.sampled_component = 0
        through = (light[2] < 0) != (eye[2] < 0)
        kind = mi.BSDFFlags.GlossyTransmission if through else mi.BSDFFlags.GlossyReflection
        drawn.sampled_type = int(kind)
        return drawn, mi.Color3f(*(value / (PI * density)).tolist())

    def eval(self, ctx, si, wo, active=True):
        return self.evaluate(si, wo)

    def pdf(self, ctx, si, wo, active=True):
        return self.density(si, wo)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.evaluate(si, wo), self.density(si, wo)

    def to_string(self):
        return f"Btf[{self.asset!r}]"


def unit(v):
    """Of length 1 in single precision, which the asset asks for."""
    v = np.array([float(v[0]), float(v[1]), float(v[2])])
    return v / max(np.linalg.norm(v), 1e-30)


mi.register_bsdf("btf", Btf)
