"""A BSDF for Mitsuba 3 that shows a packed BTF asset:

    import mitsuba as mi
    mi.set_variant("llvm_ad_rgb")           # or scalar_rgb
    import btf.mitsuba                      # registers "btf"
    plane = {"type": "rectangle", "bsdf": {"type": "btf", "filename": "leaf.spmm"}}

Variants are those whose name ends with `_rgb`.

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


def _class_of(scalar):
    """Makes the BSDF of the variant that is set, whose types of numbers are its own."""

    def rows_of(vector, width):
        """Returns a vector, or many, as an array (n, width)."""
        if scalar:
            return np.array(vector, np.float32).reshape(1, width)
        return np.asarray(vector, np.float32).reshape(width, -1).T

    def float_of(values):
        return float(values[0]) if scalar else mi.Float(np.ascontiguousarray(values, np.float32))

    def colour_of(rows):
        return mi.Color3f(*(float_of(rows[:, channel]) for channel in range(3)))

    class Btf(mi.BSDF):
        """The BSDF in one variant."""

        def __init__(self, props):
            mi.BSDF.__init__(self, props)
            self.asset = btf.open(props["filename"])
            scale_u = float(props.get("uv_scale", 1.0))
            self.scale = np.array([scale_u, float(props.get("uv_scale_v", scale_u))])
            self.flip_v = bool(props.get("flip_v", False))
            filter_name = str(props.get("filter", "nearest"))
            if filter_name not in ("nearest", "stochastic"):
                raise ValueError(f"filter is '{filter_name}': take 'nearest' or 'stochastic'")
            self.stochastic = filter_name == "stochastic"
            self.options = {"interpolation": str(props.get("interpolation", "fast"))}
            # All that an asset has is drawn by one strategy: lobes of any roughness, on either side.
            flags = mi.BSDFFlags.SpatiallyVarying | mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
            for light, eye in self.asset.meta["sides"]:
                flags |= mi.BSDFFlags.GlossyReflection if light == eye else mi.BSDFFlags.GlossyTransmission
            self.m_components = [flags]
            self.m_flags = flags

        def place(self, si):
            """Texture coordinates, v up, and the eyes' directions, which Mitsuba calls wi."""
            uv = rows_of(si.uv, 2).astype(np.float64)
            if self.flip_v:
                uv[:, 1] = 1.0 - uv[:, 1]
            uv *= self.scale
            if self.stochastic:
                uv = self.asset.uv_between(uv, _numbers_of(rows_of(si.uv, 2), rows_of(si.wi, 3)))
            return uv, _unit(rows_of(si.wi, 3))

        def evaluate(self, si, wo):
            """BRDF times cosine, which the asset's values hold times pi."""
            uv, eye = self.place(si)
            uv, light, eye = _as_many(uv, _unit(rows_of(wo, 3)), eye)
            return colour_of(_in_parallel(lambda *a: self.asset.eval(*a, **self.options), uv, light, eye) / PI)

        def density(self, si, wo):
            uv, eye = self.place(si)
            uv, light, eye = _as_many(uv, _unit(rows_of(wo, 3)), eye)
            return float_of(_in_parallel(lambda *a: self.asset.pdf(*a, **self.options), uv, light, eye))

        def sample(self, ctx, si, sample1, sample2, active=True):
            uv, eye = self.place(si)
            two, one = _as_many(rows_of(sample2, 2), rows_of(sample1, 1))
            uv, eye, at = _as_many(uv, eye, np.concatenate([two, one], axis=1))
            light, density, value = _in_parallel(lambda *a: self.asset.sample(*a, **self.options), uv, eye, at)
            is_drawn = density > 0.0
            weight = np.where(is_drawn[:, None], value / (PI * np.where(is_drawn, density, 1.0)[:, None]), 0.0)
            drawn = dr.zeros(mi.BSDFSample3f) if scalar else dr.zeros(mi.BSDFSample3f, len(eye))
            drawn.wo = mi.Vector3f(*(float_of(light[:, axis]) for axis in range(3)))
            drawn.pdf = float_of(np.where(is_drawn, density, 0.0))
            drawn.eta = 1.0
            drawn.sampled_component = 0
            through = (light[:, 2] < 0.0) != (eye[:, 2] < 0.0)
            kinds = np.where(through, int(mi.BSDFFlags.GlossyTransmission), int(mi.BSDFFlags.GlossyReflection))
            drawn.sampled_type = int(kinds[0]) if scalar else mi.UInt32(kinds.astype(np.uint32))
            weight = colour_of(weight)
            return drawn, weight if scalar else weight & mi.Bool(active)

        def eval(self, ctx, si, wo, active=True):
            value = self.evaluate(si, wo)
            return value if scalar else value & mi.Bool(active)

        def pdf(self, ctx, si, wo, active=True):
            density = self.density(si, wo)
            return density if scalar else dr.select(mi.Bool(active), density, 0.0)

        def eval_pdf(self, ctx, si, wo, active=True):
            return self.eval(ctx, si, wo, active), self.pdf(ctx, si, wo, active)

        def to_string(self):
            return f"Btf[{self.asset!r}]"

    return Btf


def _as_many(*arrays):
    """Repeats arrays of one row as often as the others have rows."""
    count = max(len(array) for array in arrays)
    return [np.broadcast_to(array, (count, array.shape[1])) for array in arrays]


def _unit(vectors):
    """Of length 1 in single precision, which the asset asks for."""
    vectors = vectors.astype(np.float64)
    return vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-30)


def _numbers_of(uv, wi):
    """Returns two numbers in 0 to 1 for each place, the same whenever the place is asked for: all calls of one path vertex
    must see one texel."""
    words = np.ascontiguousarray(np.concatenate([uv, wi], axis=1, dtype=np.float32))
    state = np.full(len(words), 0x9E3779B97F4A7C15, np.uint64)
    for column in words.view(np.uint32).T:
        state = (state ^ column) * np.uint64(0xBF58476D1CE4E5B9)
        state ^= state >> np.uint64(29)
    halves = np.stack([state >> np.uint64(40), (state >> np.uint64(16)) & np.uint64(0xFFFFFF)], -1)
    return halves.astype(np.float64) / 2.0**24


def register():
    """Makes the BSDF "btf" known to the variant that is set. Call it again after another `mi.set_variant`.

    Raises ValueError for variants without three channels of colour.
    """
    variant = mi.variant()
    if variant is None or not variant.endswith("_rgb"):
        raise ValueError(f"assets have red, green and blue: set a variant such as 'llvm_ad_rgb', not {variant!r}")
    scalar = variant.startswith("scalar")
    if not scalar:
        # Numpy cannot be traced.
        dr.set_flag(dr.JitFlag.SymbolicLoops, False)
        dr.set_flag(dr.JitFlag.SymbolicCalls, False)
        dr.set_flag(dr.JitFlag.SymbolicConditionals, False)
    kind = _class_of(scalar)
    mi.register_bsdf("btf", lambda props: kind(props))


register()
