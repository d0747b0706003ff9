"""A capture folder in the Bonn layout as one array of 8-bit values, kept decoded in a temporary folder."""

import hashlib
import os
import re
import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np

# `NNNNN tlTTT plPPP tvTTT pvPPP.png`; angles of random directions have decimals.
NAME = re.compile(r"(\d+) tl([\d.]+) pl([\d.]+) tv([\d.]+) pv([\d.]+)\.(?:png|jpg|jpeg)$")


@dataclass
class Capture:
    """`values` is `[texel, value]` with value = (view * lights + light) * 3 + channel, texels in raster order."""

    name: str
    values: np.ndarray
    height: int
    width: int
    views_deg: np.ndarray  # [view, (theta, phi)]
    lights_deg: np.ndarray  # [light, (theta, phi)]
    transfer: str

    @property
    def texels(self):
        return self.values.shape[0]

    @property
    def shape(self):
        """(views, lights, 3)."""
        return len(self.views_deg), len(self.lights_deg), 3

    @property
    def raw_bytes(self):
        return int(self.values.shape[0]) * int(self.values.shape[1])


def files_of(folder):
    """[(number, (theta_l, phi_l), (theta_v, phi_v), path)] in the order of the numbers."""
    found = []
    for path in Path(folder).rglob("*"):
        match = NAME.search(path.name)
        if match:
            number, *angles = match.groups()
            tl, pl, tv, pv = map(float, angles)
            found.append((int(number), (tl, pl), (tv, pv), path))
    return sorted(found)


def read(folder, cache=None):
    """Reads `folder`; the decoded values stay in `cache` (a folder; default: in the system's temporary one)."""
    files = files_of(folder)
    if not files:
        raise SystemExit(f"{folder} has no images named like 'NNNNN tlTTT plPPP tvTTT pvPPP.png': name a capture folder.")
    # The number is light * views + view, so its order is the order of both.
    lights = list(dict.fromkeys(light for _, light, _, _ in files))
    views = list(dict.fromkeys(view for _, _, view, _ in files))
    if len(files) != len(lights) * len(views):
        raise SystemExit(f"{folder} has {len(files)} images, not {len(views)} views x {len(lights)} lights: complete it.")
    transfer = "srgb"
    toml = Path(folder) / "capture.toml"
    if toml.is_file():
        stated = re.search(r'^transfer\s*=\s*"([^"]+)"', toml.read_text(encoding="utf-8"), re.MULTILINE)
        transfer = stated.group(1) if stated else transfer
    from PIL import Image

    width, height = Image.open(files[0][3]).size
    stamp = hashlib.sha256(repr([(str(p), p.stat().st_mtime_ns, p.stat().st_size) for *_, p in files]).encode())
    cache = Path(cache or Path(tempfile.gettempdir()) / "btf-rivals")
    cache.mkdir(parents=True, exist_ok=True)
    kept = cache / f"{Path(folder).resolve().name}-{stamp.hexdigest()[:16]}.npy"
    if not kept.is_file():
        values = np.empty((height * width, len(views), len(lights), 3), np.uint8)
        view_of = {view: index for index, view in enumerate(views)}
        light_of = {light: index for index, light in enumerate(lights)}

        def one_view(view):
            block = np.empty((height * width, len(lights), 3), np.uint8)
            for _, light, direction, path in files:
                if direction == view:
                    block[:, light_of[light]] = np.asarray(Image.open(path).convert("RGB")).reshape(-1, 3)
            values[:, view_of[view]] = block

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(one_view, views))
        part = kept.with_suffix(f".{os.getpid()}.part.npy")
        np.save(part, values.reshape(height * width, -1))
        part.replace(kept)
        del values
    values = np.load(kept, mmap_mode="r")
    name = Path(folder).resolve().name
    return Capture(name, values, height, width, np.array(views), np.array(lights), transfer)


def slice_of(capture, view):
    """One view of a capture as a capture of its own."""
    _, lights, _ = capture.shape
    values = np.ascontiguousarray(capture.values[:, view * lights * 3 : (view + 1) * lights * 3])
    return Capture(f"{capture.name}, view {view}", values, capture.height, capture.width,
                   capture.views_deg[view : view + 1], capture.lights_deg, capture.transfer)
