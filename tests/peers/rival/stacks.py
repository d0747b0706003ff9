"""Bounds without random access: AV1 with the lights of a view as frames, JPEG XL and JPEG stacks, on small captures."""

import io
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
from PIL import Image

from .domain import psnr_db

JPEG_QUALITIES = (5, 10, 20, 30, 50, 65, 80, 90)
JPEG_XL_DISTANCES = (0.5, 1, 1.5, 2.5, 4, 6, 9, 14, 20)
AV1_CRF = (18, 24, 31, 38, 44, 50, 56, 63)


def images_of(capture):
    """[view][light] images [row, column, channel]."""
    views, lights, _ = capture.shape
    stack = np.asarray(capture.values).reshape(capture.height, capture.width, views, lights, 3)
    return np.ascontiguousarray(stack.transpose(2, 3, 0, 1, 4))


def record(codec, images, decoded, size, seconds, **parameters):
    error = float(np.sum((decoded.astype(np.float64) - images) ** 2))
    return {"codec": codec, **parameters, "bytes": int(size), "psnr_db": psnr_db(error, images.size),
            "encode_seconds": round(seconds, 2), "decoded": "all texels"}


def still_points(capture, log=print):
    """JPEG (Pillow, with and without chroma subsampling) and, where imagecodecs is installed, JPEG XL: image by image."""
    images = images_of(capture)
    flat = images.reshape(-1, *images.shape[2:])
    result = []

    def one(codec, encode, decode, **parameters):
        start = time.time()
        files = [encode(image) for image in flat]
        seconds = time.time() - start
        decoded = np.stack([decode(data) for data in files]).reshape(images.shape)
        result.append(record(codec, images, decoded, sum(map(len, files)), seconds, **parameters))

    def jpeg(quality, subsampling):
        def encode(image):
            data = io.BytesIO()
            Image.fromarray(image).save(data, "JPEG", quality=quality, subsampling=subsampling, optimize=True)
            return data.getvalue()
        return encode

    for quality in JPEG_QUALITIES:
        for name, subsampling in (("4:4:4", 0), ("4:2:0", 2)):
            one("jpeg", jpeg(quality, subsampling), lambda data: np.asarray(Image.open(io.BytesIO(data)).convert("RGB")),
                quality=quality, chroma=name)
    try:
        import imagecodecs
    except ImportError:
        log("JPEG XL left out: install imagecodecs (tests/peers/requirements-rivals.txt)")
        return result
    for distance in JPEG_XL_DISTANCES:
        one("jpeg xl", lambda image: imagecodecs.jpegxl_encode(image, distance=distance, effort=7),
            imagecodecs.jpegxl_decode, distance=distance)
    return result


def serpentine(directions_deg):
    """Indices in an order in which neighbours are near: ring by ring, every other ring backwards."""
    rings = sorted({theta for theta, _ in directions_deg.tolist()})
    order = []
    for number, theta in enumerate(rings):
        ring = [i for i, (t, _) in enumerate(directions_deg.tolist()) if t == theta]
        order += ring[::-1] if number % 2 else ring
    return order


def greedy(images):
    """Indices of [light, ...] images, each followed by the most similar one left, from the first."""
    small = images[:, ::4, ::4].reshape(len(images), -1).astype(np.float32)
    gram = small @ small.T
    squares = np.diag(gram)
    distance = squares[:, None] + squares - 2 * gram
    left, order = set(range(1, len(images))), [0]
    while left:
        order.append(min(left, key=lambda i: distance[order[-1], i]))
        left.remove(order[-1])
    return order


def av1_points(capture, rate_factors=AV1_CRF, quick=False, log=print):
    """libsvtav1 and libaom as imageio-ffmpeg carries them; frames are the lights of a view, views one after the other.

    `quick` measures libsvtav1 with the lights in ring order alone.
    """
    try:
        import imageio_ffmpeg
    except ImportError:
        log("AV1 left out: install imageio-ffmpeg (tests/peers/requirements-rivals.txt)")
        return []
    ffmpeg = imageio_ffmpeg.get_ffmpeg_exe()
    images = images_of(capture)
    orders = {"rings": serpentine(capture.lights_deg), "greedy": greedy(images[0])}
    encoders = subprocess.run([ffmpeg, "-hide_banner", "-encoders"], capture_output=True, text=True).stdout
    tried = [("libsvtav1", "yuv420p", ["-preset", "2"]), ("libaom-av1", "yuv420p", ["-cpu-used", "4", "-b:v", "0"]),
             ("libaom-av1", "yuv444p", ["-cpu-used", "4", "-b:v", "0"])]
    if quick:
        tried, orders = tried[:1], {"rings": orders["rings"]}
    result = []
    for encoder, pixels, options in tried:
        if encoder not in encoders:
            log(f"{encoder} is not in this ffmpeg")
            continue
        # The slower encoder runs on one order only.
        for order_name, order in (orders if encoder == "libsvtav1" else {"rings": orders["rings"]}).items():
            for crf in rate_factors:
                frames = images[:, order].reshape(-1, *images.shape[2:])
                with tempfile.TemporaryDirectory() as folder:
                    path = Path(folder) / "stack.obu"
                    size = f"{capture.width}x{capture.height}"
                    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", size]
                    colour = ["-vf", f"scale=out_color_matrix=bt709:out_range=full:flags=accurate_rnd+full_chroma_int,format={pixels}",
                              "-colorspace", "bt709", "-color_range", "pc"]
                    start = time.time()
                    done = subprocess.run(
                        [ffmpeg, "-v", "error", "-y", *raw, "-r", "25", "-i", "-", *colour, "-c:v", encoder, "-crf", str(crf),
                         "-g", "1000", *options, "-f", "obu", str(path)], input=frames.tobytes(), capture_output=True)
                    seconds = time.time() - start
                    if done.returncode != 0:
                        log(f"{encoder} {pixels}: {done.stderr.decode(errors='replace').strip()[:200]}")
                        break
                    back = subprocess.run(
                        [ffmpeg, "-v", "error", "-i", str(path), "-vf",
                         "scale=in_color_matrix=bt709:in_range=full:flags=accurate_rnd+full_chroma_int,format=rgb24",
                         "-f", "rawvideo", "-"], capture_output=True)
                    decoded = np.frombuffer(back.stdout, np.uint8)
                    if decoded.size != frames.size:
                        log(f"{encoder} {pixels} crf {crf}: decoded {decoded.size} of {frames.size} bytes")
                        continue
                    decoded = decoded.reshape(frames.shape)
                    point = record("av1", frames, decoded, path.stat().st_size, seconds, encoder=encoder, pixels=pixels,
                                   crf=crf, order=order_name)
                    result.append(point)
                    log("av1", encoder, pixels, order_name, crf, point["bytes"], f"{point['psnr_db']:.2f} dB")
    return result
