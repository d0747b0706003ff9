#!/usr/bin/env python3
"""What an evaluation of Mitsuba's `principled` and `measured` costs on one thread, beside ours, in one run.

    evaluation_rivals.py ASSET.spmm ...

Mitsuba compiles both to vector code for a million queries at once (its variant llvm_ad_rgb; DRJIT_LIBLLVM_PATH names the
LLVM library where it finds none). Neither reads a texture: `principled` has constants, and the file of `measured` is one
made here, flat and isotropic, of the size of the RGL database's. An asset's texels, lobes and bases are read from memory, at
random. The asset's own times come from `cargo run --release -p btf-runtime --example evaluation_speed ASSET.spmm`, started in
between.
"""
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import drjit as dr
import mitsuba as mi
import numpy as np

QUERIES = 1 << 20
PASSES = 20


def flat_measured(path):
    """A file in the layout of the RGL material database, 8 elevations of 32 x 32 values, without structure."""
    from mitsuba.python import tensor_io

    theta = np.linspace(0, np.pi / 2, 8).astype(np.float32)
    ones = lambda *shape: np.ones(shape, np.float32)
    tensor_io.write(
        path,
        description=np.frombuffer(b"flat", np.uint8),
        phi_i=np.zeros(1, np.float32),
        theta_i=theta,
        ndf=ones(2, 64),
        sigma=ones(2, 64),
        vndf=ones(1, 8, 32, 32),
        luminance=ones(1, 8, 32, 32),
        rgb=0.5 * ones(1, 8, 3, 32, 32),
        jacobian=np.ones(1, np.uint8),
    )


def nanoseconds(bsdf):
    """Least time of a query, the compilation left out."""
    random = np.random.default_rng(1)

    def directions():
        z, turn = random.uniform(1e-3, 1, QUERIES), random.uniform(0, 2 * np.pi, QUERIES)
        r = np.sqrt(1 - z * z)
        return mi.Vector3f(*(x.astype(np.float32) for x in (r * np.cos(turn), r * np.sin(turn), z)))

    si = dr.zeros(mi.SurfaceInteraction3f, QUERIES)
    si.wi, wo = directions(), directions()
    si.uv = mi.Point2f(*random.uniform(0, 1, (2, QUERIES)).astype(np.float32))
    dr.eval(si.wi, wo, si.uv)
    context, least = mi.BSDFContext(), np.inf
    for _ in range(PASSES):
        dr.sync_thread()
        start = time.perf_counter()
        value = bsdf.eval(context, si, wo)
        dr.eval(value)
        dr.sync_thread()
        least = min(least, time.perf_counter() - start)
    assert np.isfinite(np.array(value)).all() and np.array(value).max() > 0
    return 1e9 * least / QUERIES


def main():
    mi.set_variant("llvm_ad_rgb")
    dr.set_thread_count(1)
    with tempfile.TemporaryDirectory() as folder:
        path = str(Path(folder) / "flat.bsdf")
        flat_measured(path)
        rivals = {
            "principled": {"type": "principled", "base_color": {"type": "rgb", "value": [0.5, 0.4, 0.3]}, "roughness": 0.4,
                           "specular": 0.5, "sheen": 0.3, "clearcoat": 0.2, "anisotropic": 0.3},
            "measured": {"type": "measured", "filename": path},
        }
        for name, description in rivals.items():
            ns = nanoseconds(mi.load_dict(description))
            print(f"Mitsuba {mi.__version__} {name}: {ns:.0f} ns ({1e3 / ns:.2f} M/s)", flush=True)
    command = ["cargo", "run", "--quiet", "--release", "-p", "btf-runtime", "--example", "evaluation_speed", *sys.argv[1:]]
    subprocess.run(command, check=True)


if __name__ == "__main__":
    main()
