"""Answers reflectance queries with Mitsuba 3: JSON on stdin, JSON on stdout.

In:  {"fresnel": [{"n_incident", "n_transmitted", "cos_incident"}, ...],
      "roughdielectric": [{"index", "gamma_along", "gamma_across", "light": [x, y, z], "eye": [x, y, z]}, ...],
      "bilambertian": [{"reflectance", "transmittance", "light", "eye"}, ...]}, any of the three may be missing.
Out: {"version": "...", "fresnel": [[reflectance, cosine of the refracted ray], ...], "roughdielectric": [value, ...],
      "bilambertian": [value, ...]}, in the order of the queries.

Directions are unit vectors away from the surface in its local frame: x along the vein, z the normal. A value is BRDF (or
BTDF) times |cosine| at the light. Mitsuba names the eye's side `si.wi` and the light's `wo`. Double precision, one band.
"""

import json
import sys

import mitsuba as mi

mi.set_variant("scalar_mono_double")


def fresnel(query):
    reflectance, cos_transmitted, _, _ = mi.fresnel(
        query["cos_incident"], query["n_transmitted"] / query["n_incident"]
    )
    # Mitsuba's cosine is negative on the far side.
    return [float(reflectance), -float(cos_transmitted)]


def evaluate(bsdf, query):
    si = mi.SurfaceInteraction3f()
    si.n = [0, 0, 1]
    si.sh_frame = mi.Frame3f([0, 0, 1])
    si.wi = query["eye"]
    return float(bsdf.eval(mi.BSDFContext(), si, query["light"])[0])


def roughdielectric(query):
    bsdf = mi.load_dict(
        {
            "type": "roughdielectric",
            "distribution": "beckmann",
            "alpha_u": query["gamma_along"],
            "alpha_v": query["gamma_across"],
            "int_ior": query["index"],
            "ext_ior": 1.0,
        }
    )
    return evaluate(bsdf, query)


def bilambertian(query):
    bsdf = mi.load_dict(
        {
            "type": "bilambertian",
            "reflectance": {"type": "uniform", "value": query["reflectance"]},
            "transmittance": {"type": "uniform", "value": query["transmittance"]},
        }
    )
    return evaluate(bsdf, query)


def main():
    queries = json.load(sys.stdin)
    answers = {"version": mi.__version__}
    for answer in (fresnel, roughdielectric, bilambertian):
        name = answer.__name__
        answers[name] = [answer(query) for query in queries.pop(name, [])]
    if queries:
        sys.exit(f"unknown queries: {', '.join(queries)}")
    # A NaN is no JSON: it fails here rather than in the reader.
    json.dump(answers, sys.stdout, allow_nan=False)


if __name__ == "__main__":
    main()
