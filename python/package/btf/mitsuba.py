"""A BSDF for Mitsuba 3 that shows a packed BTF asset:

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")           # or scalar_rgb
    import btf.mitsuba                      # registers "btf"
    plane = {"type": "rectangle", "bsdf": {"type": "btf", "filename": "leaf.spmm"}}

Parameters: filename; uv_scale, repetitions of the asset a unit of the texture (1), or uv_scale_v beside it for v; flip_v, for
meshes whose texture coordinates Mitsuba turned upside down as it read them, which is the default for .obj (false);
interpolation, "fast" or "exact" ("fast"); filter, "nearest", or "stochastic" for one of the four texels around, anew for each
sample, whose mean is their bilinear interpolation ("nearest").

In the variants of Dr.Jit each call evaluates all rays at once, on all processors. Values come from numpy and not from a traced
kernel: loops and calls are evaluated one after the other, for which `register` turns Dr.Jit's symbolic loops and calls off, and
nothing of the material is differentiated. Integrators that ask for symbolic loops themselves cannot use it.
"""

import os
from concurrent.futures import ThreadPoolExecutor

import drjit as dr
import mitsuba as mi
import numpy as np

import btf

PI = np.pi

#: Rays that a thread evaluates at once.
_CHUNK = 1 << 14
_threads = ThreadPoolExecutor(os.cpu_count() or 1)


def _in_parallel(call, *arrays):
    """Calls `call` on parts of the arrays, which lets go of the interpreter's lock, and joins its results."""
    count = len(arrays[0])
    if count <= _CHUNK:
        return call(*arrays)
    starts = range(0, count, _CHUNK)
    parts = list(_threads.map(lambda start: call(*(array[start : start + _CHUNK] for array in arrays)), starts))
    if isinstance(parts[0], tuple):
        return tuple(np.concatenate(columns) for columns in zip(*parts))
    return np.concatenate(parts)


class Btf(mi.BSDF):
    """The BSDF, in the variant that was set when the module was imported."""

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.asset = btf.open(props["filename"])
        scale_u = float(props.get("uv_scale", 1.0))
        self.scale = np.array([scale_u, float(props.get("uv_scale_v", scale_u))])
        self.flip_v = bool(props.get("flip_v", False))
        self.stochastic = {"nearest": False, "stochastic": True}[str(props.get("filter", "nearest"))]
        self.options = {"interpolation": str(props.get("interpolation", "fast"))}
        # All that an asset has is drawn by one strategy: lobes of any roughness, on either side.
        flags = mi.BSDFFlags.SpatiallyVarying | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        for light, eye in self.asset.meta["sides"]:
            flags |= mi.BSDFFlags.GlossyReflection if light == eye else mi.BSDFFlags.GlossyTransmission
        self.m_components = [flags]
        self.m_flags = flags

    def place(self, si):
        """Texture coordinates, v up, and the eyes' directions, which Mitsuba calls wi."""
        uv = _rows(si.uv, 2).astype(np.float64)
        if self.flip_v:
            uv[:, 1] = 1.0 - uv[:, 1]
        uv *= self.scale
        if self.stochastic:
            uv = self.asset.uv_between(uv, _numbers_of(si))
        return uv, _unit(_rows(si.wi, 3))

    def evaluate(self, si, wo):
        """BRDF times cosine, which the asset's values hold times pi."""
        uv, eye = self.place(si)
        light = np.broadcast_to(_unit(_rows(wo, 3)), eye.shape)
        return _colour(_in_parallel(lambda *a: self.asset.eval(*a, **self.options), uv, light, eye) / PI)

    def density(self, si, wo):
        uv, eye = self.place(si)
        light = np.broadcast_to(_unit(_rows(wo, 3)), eye.shape)
        return _float(_in_parallel(lambda *a: self.asset.pdf(*a, **self.options), uv, light, eye))

    def sample(self, ctx, si, sample1, sample2, active=True):
        uv, eye = self.place(si)
        at = np.concatenate([_rows(sample2, 2), _rows(sample1, 1)], axis=1)
        at = np.broadcast_to(at, (len(eye), 3))
        draw = lambda *a: self.asset.sample(*a, **self.options)  # noqa: E731
        light, density, value = _in_parallel(draw, uv, eye, at)
        drawn_any = density > 0.0
        weight = np.where(drawn_any[:, None], value / (PI * np.where(drawn_any, density, 1.0)[:, None]), 0.0)
        drawn = dr.zeros(mi.BSDFSample3f) if _SCALAR else dr.zeros(mi.BSDFSample3f, len(eye))
        drawn.wo = _vector(light)
        drawn.pdf = _float(np.where(drawn_any, density, 0.0))
        drawn.eta = 1.0
        drawn.sampled_component = 0
        through = (light[:, 2] < 0.0) != (eye[:, 2] < 0.0)
        kinds = [int(mi.BSDFFlags.GlossyReflection), int(mi.BSDFFlags.GlossyTransmission)]
        kinds = np.where(through, kinds[1], kinds[0]).astype(np.uint32)
        drawn.sampled_type = int(kinds[0]) if _SCALAR else mi.UInt32(kinds)
        weight = _colour(weight)
        return drawn, weight if _SCALAR else weight & mi.Bool(active)

    def eval(self, ctx, si, wo, active=True):
        value = self.evaluate(si, wo)
        return value if _SCALAR else value & mi.Bool(active)

    def pdf(self, ctx, si, wo, active=True):
        density = self.density(si, wo)
        return density if _SCALAR else dr.select(mi.Bool(active), density, 0.0)

    def eval_pdf(self, ctx, si, wo, active=True):
        return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

    def to_string(self):
        return f"Btf[{self.asset!r}]"


#: Whether the variant takes one ray at a time.
_SCALAR = mi.variant().startswith("scalar")


def _rows(vector, width):
    """Returns a vector, or many, as an array (n, width)."""
    if _SCALAR:
        return np.array(vector, np.float32).reshape(1, width)
    return np.asarray(vector, np.float32).reshape(width, -1).T if width > 1 else np.asarray(vector).reshape(-1, 1)


def _unit(vectors):
    """Of length 1 in single precision, which the asset asks for."""
    vectors = vectors.astype(np.float64)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30)


def _numbers_of(si):
    """Returns two numbers in 0 to 1 for each place, the same whenever the place is asked for: all calls of one path vertex
    must see one texel."""
    words = np.ascontiguousarray(np.concatenate([_rows(si.uv, 2), _rows(si.wi, 3)], axis=1, dtype=np.float32))
    state = np.full(len(words), 0x9E3779B97F4A7C15, np.uint64)
    for column in words.view(np.uint32).T:
        state = (state ^ column) * np.uint64(0xBF58476D1CE4E5B9)
        state ^= state >> np.uint64(29)
    halves = np.stack([state >> np.uint64(40), (state >> np.uint64(16)) & np.uint64(0xFFFFFF)], -1)
    return halves.astype(np.float64) / 2.0**24


def _float(values):
    return float(values[0]) if _SCALAR else mi.Float(np.ascontiguousarray(values, np.float32))


def _vector(rows):
    return mi.Vector3f(*(_float(rows[:, axis]) for axis in range(3)))


def _colour(rows):
    return mi.Color3f(*(_float(rows[:, channel]) for channel in range(3)))


def register():
    """Makes the BSDF "btf" known to the variant that is set. Call it again after another `mi.set_variant`."""
    global _SCALAR
    _SCALAR = mi.variant().startswith("scalar")
    if not _SCALAR:
        # Numpy cannot be traced.
        dr.set_flag(dr.JitFlag.SymbolicLoops, False)
        dr.set_flag(dr.JitFlag.SymbolicCalls, False)
        dr.set_flag(dr.JitFlag.SymbolicConditionals, False)
    mi.register_bsdf("btf", lambda props: Btf(props))


register()
