"""The upper envelope of measured points: the best error that any of them reaches within each number of bytes.

Between points of the front it is linear in the logarithm of bytes. The concave hull over the same axis is told beside it:
it lies above what the codecs reach wherever their curve bends upwards, so it bounds what denser sampling could find.
"""

import math

# Bytes at which envelopes are told; 1 MB = 1e6 bytes.
SIZES = tuple(round(mb * 1e6) for mb in (0.1, 0.2, 0.25, 0.3, 0.4, 0.5, 0.75, 1, 1.5, 2, 3, 4))
# Codecs that make up the rival.
RIVALS = ("fmf", "local pca", "strong")


def front(points):
    """[(bytes, psnr_db)] of the points that no smaller or equal one beats, both rising."""
    rising = []
    for size, db in sorted((p["bytes"], -p["psnr_db"]) for p in points):
        if not rising or -db > rising[-1][1]:
            rising.append((size, -db))
    return rising


def hull(points):
    """Corners [(bytes, psnr_db)] of the upper concave hull of the front over log bytes."""
    corners = []
    for size, db in front(points):
        while len(corners) >= 2:
            (x0, y0), (x1, y1) = corners[-2:]
            if (y1 - y0) * (math.log(size) - math.log(x0)) <= (db - y0) * (math.log(x1) - math.log(x0)):
                corners.pop()
            else:
                break
        corners.append((size, db))
    return corners


def at(corners, size):
    """psnr_db of a front or hull at `size` bytes, linear in log bytes; None below the smallest, the best beyond the largest."""
    if not corners or size < corners[0][0]:
        return None
    for (x0, y0), (x1, y1) in zip(corners, corners[1:]):
        if size <= x1:
            return y0 + (y1 - y0) * (math.log(size) - math.log(x0)) / (math.log(x1) - math.log(x0))
    return corners[-1][1]


def bytes_at(corners, db):
    """Smallest size at which a front or hull reaches `db`; None beyond it."""
    if not corners or db > corners[-1][1]:
        return None
    if db <= corners[0][1]:
        return corners[0][0]
    for (x0, y0), (x1, y1) in zip(corners, corners[1:]):
        if db <= y1:
            return math.exp(math.log(x0) + (math.log(x1) - math.log(x0)) * (db - y0) / (y1 - y0))
    return None


def of_codecs(points, codecs=RIVALS):
    """The points of these codecs; those decoded on a sample of texels do not count."""
    return [p for p in points if p["codec"] in codecs and p.get("decoded", "all texels") == "all texels"]


def reference(points):
    """Published local PCA 32 x 8, whose bytes ours must divide by 8; None where it was not measured."""
    for point in points:
        if point["codec"] == "local pca" and (point.get("clusters"), point.get("components")) == (32, 8):
            return point
    return None


def summary(report):
    """{"envelope": {bytes: dB}, "hull": {...}, "strong_plus": {...}, "local_pca_32x8": {...}} of a report."""
    points = report["points"]
    main = front(of_codecs(points))
    told = {"envelope": main, "hull": hull(of_codecs(points))}
    if any(p["codec"] == "strong+" for p in points):
        told["strong_plus"] = front(of_codecs(points, RIVALS + ("strong+",)))
    for codec in sorted({p["codec"] for p in points} - set(RIVALS) - {"strong+"}):
        told[codec] = front(of_codecs(points, (codec,)))
    result = {name: {str(size): at(line, size) for size in SIZES} for name, line in told.items()}
    lpca = reference(points)
    if lpca:
        result["local_pca_32x8"] = {"bytes": lpca["bytes"], "psnr_db": lpca["psnr_db"],
                                    "rival_bytes_at_its_psnr": bytes_at(main, lpca["psnr_db"])}
    return result


def table(report):
    """The summary as lines of text."""
    told = summary(report)
    columns = [name for name in told if name != "local_pca_32x8"]
    wide = [max(len(name), 7) for name in columns]
    lines = [f"{report['capture']}: {report['texels']} texels, {report['views']} views x {report['lights']} lights",
             f"{'MB':>6} " + " ".join(f"{name:>{w}}" for name, w in zip(columns, wide))]
    for size in SIZES:
        cells = (told[name][str(size)] for name in columns)
        lines.append(f"{size / 1e6:>6g} " + " ".join(
            f"{'-' if cell is None else format(cell, '.2f'):>{w}}" for cell, w in zip(cells, wide)))
    lpca = told.get("local_pca_32x8")
    if lpca:
        size = lpca["rival_bytes_at_its_psnr"]
        lines.append(f"published local PCA 32 x 8: {lpca['bytes']} bytes, {lpca['psnr_db']:.2f} dB; an eighth is "
                     f"{lpca['bytes'] // 8} bytes; the envelope passes its dB at "
                     + ("no size" if size is None else f"{size:.0f} bytes"))
    return "\n".join(lines)
