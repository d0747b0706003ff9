#!/usr/bin/env python3
"""Measures the rival codecs on a capture folder: bytes, psnr_db over all 8-bit values, parameters, seconds.

    python tests/peers/rivals.py CAPTURE --json OUT.json [--codec published,strong,plus,stacks,av1,neural]
    python tests/peers/rivals.py envelope OUT.json

See tests/peers/README.md.
"""
import os

# One BLAS thread for each worker thread: set before numpy is imported.
for name in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"):
    os.environ.setdefault(name, "1")

import argparse
import json
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from rival import capture as captures
from rival import coordinates, envelope, holdout, offgrid, plus, published, stacks, strong
from rival.domain import Domain, psnr_db

TARGETS = [1e5, 1.25e5, 1.6e5, 2e5, 2.5e5, 3e5, 4e5, 5e5, 6.3e5, 7.9e5, 1e6, 1.26e6, 1.58e6, 2e6, 2.5e6, 3.2e6, 4e6, 4.5e6]


QUICK_TARGETS = [1.6e5, 2.5e5, 5e5, 1e6, 2e6, 4e6]


def log(*words):
    print(f"[{time.time() - START:6.0f} s]", *words, file=sys.stderr, flush=True)


START = time.time()


def brief(point):
    """A point's parameters for the log."""
    skipped = ("codec", "psnr_db", "estimated_psnr_db", "encode_seconds", "decoded", "curve", "held")
    return " ".join(f"{key}={value}" for key, value in point.items() if key not in skipped) + f" -> {point['psnr_db']:.2f} dB"


class Report:
    """What was measured, written after every step so that a long run can be watched."""

    def __init__(self, data, arguments):
        views, lights, _ = data.shape
        self.path = Path(arguments.json)
        self.told = {"capture": data.name, "texels": data.texels, "views": views, "lights": lights,
                     "raw_bytes": data.raw_bytes, "transfer": data.transfer, "seed": arguments.seed, "points": []}
        if arguments.add and self.path.is_file():
            self.told = json.loads(self.path.read_text(encoding="utf-8"))

    def replace(self, codecs):
        """Forgets earlier points of codecs that are measured anew."""
        self.told["points"] = [p for p in self.told["points"] if p["codec"] not in codecs]

    def add(self, points):
        self.told["points"] += points
        for point in points:
            log(point["codec"], brief(point))
        self.save()

    def save(self):
        self.told["seconds"] = round(time.time() - START, 1)
        self.told["peak_memory_bytes"] = peak_memory_bytes()
        self.told["summary"] = envelope.summary(self.told)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.write_text(json.dumps(self.told, indent=1) + "\n", encoding="utf-8")


def peak_memory_bytes():
    """Of this process, mapped pages of the decoded capture included; None where the system does not tell."""
    try:
        import resource
    except ImportError:
        return None
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def measure(arguments):
    data = captures.read(arguments.capture, arguments.cache)
    if arguments.slice is not None:
        data = captures.slice_of(data, arguments.slice)
    views, lights, _ = data.shape
    log(f"{data.name}: {data.texels} texels, {views} views x {lights} lights")
    report = Report(data, arguments)
    seed = arguments.seed
    codecs = [codec for codec in arguments.codec.split(",") if codec != "none"]
    gamma = Domain("gamma", data.transfer)
    # The neural rivals measure held-back pairs and other directions themselves, within one training.
    others = codecs != ["neural"]
    held = None
    if arguments.leave_out or arguments.held_out:
        held = (holdout.read_pairs(arguments.held_out, lights) if arguments.held_out
                else holdout.held_pairs(views * lights, arguments.leave_out, seed))
    every_target = QUICK_TARGETS if arguments.quick else TARGETS
    # Strong+ and the neural rivals measure other directions themselves.
    strong_off_grid = arguments.off_grid and ("strong" in codecs or not {"plus", "neural"} & set(codecs))
    if "strong" in codecs or strong_off_grid:
        for kind in arguments.domains.split(","):
            domain = Domain(kind, data.transfer)
            frame = coordinates.measure(data, domain, arguments.rank, seed)
            log(f"{frame.rank} coordinates ({kind})")
            spaces = strong.spaces_of(frame, log)
            found, chosen = strong.search(frame, spaces, data.texels, max(TARGETS), seed, log=log)
            if "strong" in codecs:
                if kind == "gamma":
                    report.replace(["strong"])
                for estimate in strong.best_at(found, every_target if kind == "gamma" else every_target[2::3]):
                    report.add([strong.measure(data, domain, frame, spaces, estimate, chosen, seed)[0]])
            if strong_off_grid and kind == "gamma":
                other = captures.read(arguments.off_grid, arguments.cache)
                estimate = strong.best_at(found, [arguments.bytes])[0]
                _, encoded = strong.measure(data, domain, frame, spaces, estimate, chosen, seed)
                told = {"bytes": encoded.bytes, "clusters": encoded.clusters, "components": encoded.components}
                report.told["off_grid"] = offgrid.measure(data, other, domain, offgrid.strong_groups(encoded), told)
                log("off grid", report.told["off_grid"])
                report.save()
            del frame, spaces
    if "plus" in codecs:
        report.replace(["strong+"])
        measure_plus(data, gamma, arguments, report)
    if "published" in codecs:
        report.replace(["fmf", "local pca"])
        domain = Domain("linear", data.transfer)
        frame = coordinates.measure(data, domain, min(arguments.rank, 192), seed)
        report.add(published.fmf_points(data, domain, frame))
        for clusters in (32,) if arguments.quick else published.LPCA_CLUSTERS:
            components = (4, 8) if arguments.quick else published.LPCA_COMPONENTS
            report.add(published.lpca_points(data, domain, frame, seed, (clusters,), components, log))
        del frame
    if "stacks" in codecs:
        report.replace(["jpeg", "jpeg xl"])
        report.add(stacks.still_points(data, log))
    if "stacks" in codecs or "av1" in codecs:
        report.replace(["av1"])
        report.add(stacks.av1_points(data, arguments.crf, arguments.quick, log))
    if arguments.book:
        report.replace(["book"])
        report.add([book_point(data, captures.read(arguments.book, arguments.cache), arguments.book_bytes)])
    if "neural" in codecs:
        import torch
        from rival import neural

        torch.set_num_threads(1)

        other = captures.read(arguments.off_grid, arguments.cache) if arguments.off_grid else None
        kept = Path(arguments.keep) if arguments.keep else None
        for point in neural.points(data, arguments.kinds.split(","), arguments.latents, 60 * arguments.minutes, held or (),
                                   other, log, kept, arguments.rate):
            # Points of other training times stay, so that their difference can be told.
            same = lambda p: all(p.get(key) == point[key] for key in ("codec", "latents", "training_seconds", "rate"))
            report.told["points"] = [p for p in report.told["points"] if not same(p)]
            report.add([point])
    if held and others:
        report.told["leave_out"] = holdout.measure(data, gamma, held, arguments.bytes, seed=1, log=log) | {"seed": seed}
        log("leave out", report.told["leave_out"])
    report.save()
    print(envelope.table(report.told))


def measure_plus(data, domain, arguments, report):
    """Strong+ at its sizes, with `--off-grid` also at other directions from half a megabyte on."""
    other = captures.read(arguments.off_grid, arguments.cache) if arguments.off_grid else None
    frame = coordinates.measure(data, domain, max(arguments.rank, plus.RANK), arguments.seed)
    log(f"{frame.rank} coordinates for strong+")

    def then(coded, point):
        if other is not None and point["target"] >= min(arguments.bytes, 5e5):
            told = {"bytes": point["bytes"]}
            point["off_grid"] = offgrid.measure(data, other, domain, offgrid.plus_groups(coded), told)
        report.add([point])

    targets = arguments.targets or plus.TARGETS
    clusters, sides = (plus.CLUSTERS[1::2], plus.SIDES[::2]) if arguments.quick else (plus.CLUSTERS, plus.SIDES)
    plus.sweep(data, domain, frame, targets, arguments.seed, log, clusters, sides, then)


def book_point(data, decoded, size):
    """A code book that was decoded to images, against this capture where the directions agree."""
    picked = []
    for v, view in enumerate(decoded.views_deg.tolist()):
        for l, light in enumerate(decoded.lights_deg.tolist()):
            if view in data.views_deg.tolist() and light in data.lights_deg.tolist():
                own = data.views_deg.tolist().index(view) * data.shape[1] + data.lights_deg.tolist().index(light)
                picked.append((own, v * decoded.shape[1] + l))
    columns = [holdout.values_of_pairs([pair[side] for pair in picked]) for side in (0, 1)]
    difference = decoded.values[:, columns[1]].astype("f4") - data.values[:, columns[0]]
    return {"codec": "book", "pairs": len(picked), "bytes": size, "encode_seconds": None, "decoded": "all texels",
            "psnr_db": psnr_db(float((difference.astype("f8") ** 2).sum()), difference.size)}


def rate_factors(text):
    """The numbers of a list `18,24,31`, each 0 to 63."""
    factors = [int(number) for number in text.split(",")]
    if not all(0 <= factor <= 63 for factor in factors):
        raise argparse.ArgumentTypeError("rate factors are 0 to 63")
    return factors


def sizes(text):
    """Bytes of a list `64e3,1e6`."""
    return tuple(float(number) for number in text.split(","))


def main():
    if sys.argv[1:2] == ["envelope"]:
        for path in sys.argv[2:]:
            print(envelope.table(json.loads(Path(path).read_text(encoding="utf-8"))))
        return
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("capture", help="folder in the Bonn layout")
    parser.add_argument("--json", required=True, help="where the report goes")
    parser.add_argument("--add", action="store_true", help="keep what the report has of other codecs and measurements")
    parser.add_argument("--codec", default="strong,published",
                        help="of: strong, published, plus, stacks, av1 (alone), neural; or none")
    parser.add_argument("--domains", default="gamma", help="of the strong rival: gamma, log")
    parser.add_argument("--quick", action="store_true", help="six sizes of strong, fewer forms of plus, 32 x 4 and 32 x 8 "
                                                             "of local PCA, AV1 by libsvtav1 in ring order alone")
    parser.add_argument("--crf", metavar="LIST", type=rate_factors, default=stacks.AV1_CRF,
                        help="AV1's rate factors, 0 to 63 (default: eight from 18 to 63)")
    parser.add_argument("--targets", metavar="LIST", type=sizes, help="bytes at which plus is measured (64e3 to 4e6)")
    parser.add_argument("--slice", type=int, metavar="VIEW", help="one view of the capture only")
    parser.add_argument("--leave-out", type=float, metavar="SHARE", help="hold back pairs as `btf-fit fit --leave-out` does")
    parser.add_argument("--held-out", metavar="FILE", help="hold back these pairs: JSON [[view, light], ...]")
    parser.add_argument("--off-grid", metavar="CAPTURE2", help="the same material at other directions")
    parser.add_argument("--bytes", type=float, default=2e6, help="size of --leave-out and --off-grid (2e6)")
    parser.add_argument("--book", metavar="FOLDER", help="images that a code book of the same material decodes to")
    parser.add_argument("--book-bytes", type=int, default=1771420, help="bytes of the book (WALLPAPER's: 1771420)")
    parser.add_argument("--kinds", default="neural,neumip", help="of --codec neural: neural (the smaller one), neumip")
    parser.add_argument("--latents", metavar="LIST", type=lambda text: [int(number) for number in text.split(",")],
                        help="of --codec neural: latents a texel (default: of each kind)")
    parser.add_argument("--rate", type=float, default=5e-3,
                        help="of --codec neural: first learning rate (5e-3; 1.5e-3 where few components say nearly all)")
    parser.add_argument("--keep", metavar="FOLDER", help="of --codec neural: where the encoded bytes go")
    parser.add_argument("--minutes", type=float, default=6, help="of --codec neural: CPU minutes of training of one point (6)")
    parser.add_argument("--rank", type=int, default=384, help="coordinates of the search")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cache", help="folder for decoded captures (default: in the temporary folder)")
    measure(parser.parse_args())


if __name__ == "__main__":
    main()
