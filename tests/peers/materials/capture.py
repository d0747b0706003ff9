"""Directions, file names and images of a capture in the Bonn layout (docs/guide/captures.md).

The frame is that of docs/reference/model.md, section 1: x to the right along the rows, y up towards smaller rows, z
towards the eye; azimuth counter-clockwise from x. The tile is 1 wide, so lengths are in tile widths. A sample X is
`pi * BRDF * cos(light)`: 1 is a white Lambertian surface lit along its normal.
"""

import struct
from pathlib import Path

import numpy as np

# Polar angle in degrees and number of directions of each ring: Sattler, Sarlette, Klein 2003 (UBO2003).
UBO81_RINGS = ((0, 1), (15, 6), (30, 12), (45, 18), (60, 20), (75, 24))
# Random directions stay within this angle of the normal, so that no image is a few texels stretched over the tile.
RANDOM_MAX_THETA_DEG = 82.0
# Side of the tile, for programs that ask for it; nothing here depends on it.
SIZE_MM = 10.0


def ubo81_deg():
    """Returns the 81 directions of UBO2003 as rows of (theta, phi) in degrees."""
    rings = [(theta, 360.0 * index / count) for theta, count in UBO81_RINGS for index in range(count)]
    return np.array(rings, dtype=np.float64)


def random_deg(count, generator):
    """Draws `count` directions evenly over the solid angle within RANDOM_MAX_THETA_DEG, to 0.01 degrees, sorted."""
    lowest = np.cos(np.radians(RANDOM_MAX_THETA_DEG))
    theta = np.degrees(np.arccos(1.0 - generator.random(count) * (1.0 - lowest)))
    phi = 360.0 * generator.random(count)
    drawn = np.stack([np.round(theta, 2), np.floor(phi * 100.0) / 100.0], axis=1)
    return drawn[np.lexsort((drawn[:, 1], drawn[:, 0]))]


def sets_of(word, seed):
    """Returns (views, lights) in degrees for `ubo81` or `random:N`.

    `ubo81` has the same directions for both. `random:N` draws N views and N other lights.
    """
    if word == "ubo81":
        return ubo81_deg(), ubo81_deg()
    kind, _, count = word.partition(":")
    if kind != "random" or not count.isdigit() or int(count) < 1:
        raise SystemExit(f"`{word}` names no directions: write ubo81 or random:N.")
    generator = np.random.default_rng([seed, 0xD1EC])
    return random_deg(int(count), generator), random_deg(int(count), generator)


def unit_vector(theta_deg, phi_deg):
    """Returns the unit vector of a polar angle and an azimuth."""
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)])


def srgb_bytes(linear):
    """Encodes linear values by the sRGB curve (IEC 61966-2-1) and rounds them to 8 bits; values above 1 are clipped."""
    clipped = np.clip(linear, 0.0, 1.0)
    encoded = np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1.0 / 2.4) - 0.055)
    return np.round(encoded * 255.0).astype(np.uint8)


def angle(degrees):
    """Writes an angle with three digits before the point and as many behind it as it needs, at most two."""
    return f"{degrees:03.0f}" if degrees == round(degrees) else f"{degrees:06.2f}"


class Writer:
    """Writes the images of one capture, `light * views + view` being the number in a name."""

    def __init__(self, folder, views_deg, lights_deg, image_format, wavelengths_nm=None):
        self.folder = Path(folder)
        if self.folder.exists() and any(self.folder.iterdir()):
            raise SystemExit(f"{self.folder} is not empty: name a new folder.")
        self.views_deg, self.lights_deg, self.format = views_deg, lights_deg, image_format
        # Channels of an EXR file: colours, or bands by their wavelengths.
        self.channels = ("R", "G", "B") if wavelengths_nm is None else [f"{nm:g}nm" for nm in wavelengths_nm]
        for theta, phi in views_deg:
            (self.folder / f"tv{angle(theta)}_pv{angle(phi)}").mkdir(parents=True, exist_ok=True)

    def write_image(self, view, light, linear):
        """Writes the image `[row, column, channel]` of a pair of indices."""
        eye = [angle(a) for a in self.views_deg[view]]
        lamp = [angle(a) for a in self.lights_deg[light]]
        number = light * len(self.views_deg) + view
        name = f"{number:05d} tl{lamp[0]} pl{lamp[1]} tv{eye[0]} pv{eye[1]}.{self.format}"
        path = self.folder / f"tv{eye[0]}_pv{eye[1]}" / name
        if self.format == "exr":
            path.write_bytes(exr_bytes(linear, self.channels))
        else:
            from PIL import Image

            Image.fromarray(srgb_bytes(linear)).save(path, compress_level=3)

    def write_description(self, name, provenance):
        """Writes capture.toml: what the file names cannot say."""
        lines = [f'name = "{name}"', 'cosine = "included"', "scale = 1.0", 'side = "front"',
                 f"size_mm = [{SIZE_MM}, {SIZE_MM}]", f'provenance = "{provenance}"']
        if self.format == "png":
            lines.insert(1, 'transfer = "srgb"')
        (self.folder / "capture.toml").write_text("\n".join(lines) + "\n", encoding="utf-8")


def exr_bytes(linear, channels=("R", "G", "B")):
    """Encodes an image as OpenEXR: one part, scan lines, no compression, half floats."""
    height, width, count = linear.shape
    # A file's channels are sorted by their names.
    order = sorted(range(count), key=lambda channel: channels[channel])

    def attribute(name, kind, value):
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value

    rows = struct.pack("<iBBBBii", 1, 0, 0, 0, 0, 1, 1)
    channel = b"".join(channels[c].encode() + b"\0" + rows for c in order) + b"\0"
    window = struct.pack("<4i", 0, 0, width - 1, height - 1)
    head = struct.pack("<2i", 20000630, 2)
    head += attribute("channels", "chlist", channel) + attribute("compression", "compression", b"\0")
    head += attribute("dataWindow", "box2i", window) + attribute("displayWindow", "box2i", window)
    head += attribute("lineOrder", "lineOrder", b"\0") + attribute("pixelAspectRatio", "float", struct.pack("<f", 1.0))
    head += attribute("screenWindowCenter", "v2f", struct.pack("<2f", 0.0, 0.0))
    head += attribute("screenWindowWidth", "float", struct.pack("<f", 1.0)) + b"\0"
    line_bytes = width * 2 * count
    first = len(head) + 8 * height
    offsets = struct.pack(f"<{height}Q", *(first + row * (line_bytes + 8) for row in range(height)))
    planes = np.minimum(linear, 65504.0).astype("<f2")[:, :, order].transpose(0, 2, 1)
    lines = (struct.pack("<2i", row, line_bytes) + planes[row].tobytes() for row in range(height))
    return head + offsets + b"".join(lines)
