"""Parallel rays through a periodic tile: places of samples, marching, shadow maps, light that bounces once.

All rays of an image are parallel and their places on the plane z = 0 form a grid. So all of them meet a slice
z = constant of the tile at one shift, and marching needs no search per ray. Arrays over the tile are in the order of an
image: rows from the top (large y), columns from the left.
"""

import numpy as np

# Samples of a texel: an additive recurrence of the plastic number (Roberts 2018), moved so that its mean is the centre.
PLASTIC = 1.32471795724474602596


def sample_offsets(count):
    """Returns `count` places inside a texel as rows of (column, row) offsets from its centre, in texels."""
    steps = np.arange(1, count + 1)[:, None] * np.array([1.0 / PLASTIC, 1.0 / PLASTIC**2])
    places = (0.5 + steps) % 1.0
    return np.clip(places - places.mean(axis=0), -0.5, 0.5)


def grid_places(rays, offset):
    """Returns x and y, in tile widths, of a grid of rays x rays texels sampled at `offset` from their centres."""
    columns = (np.arange(rays) + 0.5 + offset[0]) / rays
    rows = (np.arange(rays) + 0.5 + offset[1]) / rays
    x, y = np.meshgrid(columns, 1.0 - rows)
    return x.astype(np.float32), y.astype(np.float32)


def slope(direction):
    """Returns how far, in x and y, a ray along `direction` moves while it rises by 1."""
    return direction[0] / direction[2], direction[1] / direction[2]


def points_at(rays, offset, direction, height):
    """Returns the points `[ray, 3]` at which rays through the grid on z = 0 have the heights `height`."""
    x, y = grid_places(rays, offset)
    along_x, along_y = slope(direction)
    z = height.reshape(rays, rays).astype(np.float32)
    return np.stack([x + z * np.float32(along_x), y + z * np.float32(along_y), z], axis=-1).reshape(-1, 3)


class Shift:
    """Reads periodic slices at a grid of rays, each slice moved by some columns and rows, bilinearly."""

    def __init__(self, slice_side, rays, offset):
        pitch = slice_side / rays
        self.side = slice_side
        self.columns = (np.arange(rays) + 0.5 + offset[0]) * pitch - 0.5
        self.rows = (np.arange(rays) + 0.5 + offset[1]) * pitch - 0.5

    def read(self, values, column_shift, row_shift):
        """Returns `values` at the grid's places plus a shift in elements of the slice."""
        rows, columns = self.rows + row_shift, self.columns + column_shift
        row, column = np.floor(rows).astype(np.int64), np.floor(columns).astype(np.int64)
        row_part = (rows - row).astype(np.float32)[:, None]
        column_part = (columns - column).astype(np.float32)
        upper = values.take(row % self.side, axis=0)
        lower = values.take((row + 1) % self.side, axis=0)
        band = upper + row_part * (lower - upper)
        left = band.take(column % self.side, axis=1)
        right = band.take((column + 1) % self.side, axis=1)
        return left + column_part * (right - left)


def march(solid, top, pitch, direction, rays, offset):
    """Returns the height `[rays, rays]` at which each ray first meets `solid > 0`, coming down from `top`.

    `solid[k]` is the slice at `top - k * pitch`; the function between slices and elements is trilinear. Steps are at
    most one slice down and one element sideways. A crossing is found by linear interpolation within its step, so
    walls thinner than an element can be missed and edges are true to about a tenth of an element elsewhere.
    Rays that meet nothing end at the lowest slice.
    """
    layers, side = solid.shape[0], solid.shape[1]
    along_x, along_y = slope(direction)
    per_layer = max(1.0, pitch * side * np.hypot(along_x, along_y))
    steps = int(np.ceil((layers - 1) * per_layer)) + 1
    shift = Shift(side, rays, offset)
    height = np.full((rays, rays), top - (layers - 1) * pitch, np.float32)
    waiting = np.ones((rays, rays), bool)
    before = None
    for depth in np.linspace(0.0, layers - 1.0, steps):
        layer = min(int(depth), layers - 2)
        part = np.float32(depth - layer)
        z = top - depth * pitch
        upper = shift.read(solid[layer], z * along_x * side, -z * along_y * side)
        lower = shift.read(solid[layer + 1], z * along_x * side, -z * along_y * side) if part > 0 else upper
        now = upper + part * (lower - upper)
        if before is None:
            crossed = now > 0
            height[crossed] = z
        else:
            crossed = waiting & (now > 0)
            if crossed.any():
                share = before[crossed] / (before[crossed] - now[crossed])
                height[crossed] = last_z + share * (z - last_z)
        waiting &= ~crossed
        if not waiting.any():
            break
        before, last_z = now, z
    return height


def march_heights(heights, top, direction, rays, offset, steps):
    """Returns where each ray first meets a periodic height field, found in `steps` equal steps and one secant."""
    along_x, along_y = slope(direction)
    side = heights.shape[0]
    shift = Shift(side, rays, offset)
    met = np.full((rays, rays), np.float32(heights.min()))
    waiting = np.ones((rays, rays), bool)
    before = None
    for z in np.linspace(top, float(heights.min()) - 1e-4, steps):
        now = shift.read(heights, z * along_x * side, -z * along_y * side) - np.float32(z)
        crossed = waiting & (now > 0)
        if before is None:
            met[crossed] = z
        elif crossed.any():
            share = before[crossed] / (before[crossed] - now[crossed])
            met[crossed] = last_z + share * (z - last_z)
        waiting &= ~crossed
        if not waiting.any():
            break
        before, last_z = now, z
    return met


def interleaved(trace, rays, phases):
    """Returns a map of rays x rays heights put together of phases x phases coarser grids that `trace` follows.

    `trace(rays, offset)` follows a grid. An offset is in its texels.
    """
    coarse = rays // phases
    whole = np.empty((coarse, phases, coarse, phases), np.float32)
    for row in range(phases):
        for column in range(phases):
            offset = ((column + 0.5) / phases - 0.5, (row + 0.5) / phases - 0.5)
            whole[:, row, :, column] = trace(coarse, offset)
    return whole.reshape(rays, rays)


class ShadowMap:
    """Heights at which light first meets the material, on a grid of places of z = 0 (Williams 1978).

    A point is lit if it is not below the height of its place; the four nearest places vote with bilinear weights
    (Reeves 1987). An edge of a shadow is true to a map's element.
    """

    def __init__(self, heights, direction):
        self.side = heights.shape[0]
        self.along = slope(direction)
        self.padded = np.pad(heights, ((0, 1), (0, 1)), mode="wrap").ravel()

    def lit_share(self, points, bias):
        """Returns the share of light, 0 to 1, that reaches points `[n, 3]`; `bias` is a height in tile widths."""
        side = np.float32(self.side)
        z = points[:, 2]
        column = (points[:, 0] - z * np.float32(self.along[0])) * side - np.float32(0.5)
        row = (1 - points[:, 1] + z * np.float32(self.along[1])) * side - np.float32(0.5)
        column -= np.floor(column / side) * side
        row -= np.floor(row / side) * side
        left, top = column.astype(np.int32), row.astype(np.int32)
        np.minimum(left, self.side - 1, out=left)
        np.minimum(top, self.side - 1, out=top)
        column -= left
        row -= top
        place = top * (self.side + 1) + left
        raised = z + np.float32(bias)
        upper_left = raised >= self.padded.take(place)
        upper_right = raised >= self.padded.take(place + 1)
        place += self.side + 1
        lower_left = raised >= self.padded.take(place)
        lower_right = raised >= self.padded.take(place + 1)
        upper = (1 - column) * upper_left + column * upper_right
        lower = (1 - column) * lower_left + column * lower_right
        return upper + row * (lower - upper)


class Medium:
    """Light that lit points give to the points around them, as in an even medium, by convolution on a grid.

    A source of power P gives the fluence P exp(-distance / mean_free_path) / (4 pi distance^2) in every direction. All
    lengths are in tile widths; `softening` keeps a point from lighting itself.
    """

    def __init__(self, side, low, high, mean_free_path, softening):
        self.side, self.low = side, low
        self.layers = int(np.ceil((high - low) * side)) + 1
        self.padded = 1 << int(np.ceil(np.log2(self.layers + min(self.layers, 4 * mean_free_path * side))))
        x = np.minimum(np.arange(side), side - np.arange(side)) / side
        z = ((np.arange(self.padded) + self.padded // 2) % self.padded - self.padded // 2) / side
        square = z[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2
        kernel = np.exp(-np.sqrt(square) / mean_free_path) / (4 * np.pi * (square + softening**2))
        self.spectrum = np.fft.rfftn(kernel).astype(np.complex64)

    def index(self, points):
        """Returns the flat index of the grid's cell in which each point `[n, 3]` lies."""
        column = np.floor(points[:, 0] * self.side).astype(np.int64) % self.side
        row = np.floor((1 - points[:, 1]) * self.side).astype(np.int64) % self.side
        layer = np.clip(np.round((points[:, 2] - self.low) * self.side).astype(np.int64), 0, self.layers - 1)
        return (layer * self.side + row) * self.side + column

    def fluence(self, points, power):
        """Returns the fluence `[cell, channel]` that sources of `power` `[n, channel]` at `points` make."""
        cells = self.index(points)
        shape = (self.padded, self.side, self.side)
        field = np.empty((self.layers * self.side**2, power.shape[1]), np.float32)
        for channel in range(power.shape[1]):
            source = np.bincount(cells, weights=power[:, channel], minlength=self.padded * self.side**2)
            spectrum = np.fft.rfftn(source.reshape(shape).astype(np.float32)) * self.spectrum
            field[:, channel] = np.fft.irfftn(spectrum, s=shape, axes=(0, 1, 2))[: self.layers].reshape(-1)
        return field


def periodic_noise(shape, longest, shortest, generator, falloff=1.5):
    """Returns periodic noise of mean 0 and deviation 1 whose waves are `longest` to `shortest` elements long."""
    frequency = np.sqrt(sum(np.square(axis) for axis in np.meshgrid(*map(np.fft.fftfreq, shape), indexing="ij")))
    keep = (frequency >= 1.0 / longest) & (frequency <= 1.0 / shortest)
    if not keep.any():
        raise ValueError(f"no waves of {shortest} to {longest} elements fit into {shape}")
    weight = np.where(keep, np.maximum(frequency, 1e-9) ** -falloff, 0.0)
    noise = np.fft.ifftn(np.fft.fftn(generator.standard_normal(shape)) * weight).real
    return (noise / noise.std()).astype(np.float32)


def read_trilinear(volume, top, pitch, points):
    """Returns a periodic volume `[layer, row, column]` at points `[n, 3]`; heights are clamped to its own."""
    layers, side = volume.shape[0], volume.shape[1]
    column = points[:, 0] * side - 0.5
    row = (1 - points[:, 1]) * side - 0.5
    layer = np.clip((top - points[:, 2]) / pitch, 0, layers - 1.001)
    result = np.zeros(len(points), np.float32)
    base = [np.floor(axis).astype(np.int64) for axis in (layer, row, column)]
    part = [(axis - low).astype(np.float32) for axis, low in zip((layer, row, column), base)]
    for corner in range(8):
        bits = (corner >> 2 & 1, corner >> 1 & 1, corner & 1)
        weight = np.ones(len(points), np.float32)
        for bit, share in zip(bits, part):
            weight = weight * (share if bit else 1 - share)
        result += weight * volume[base[0] + bits[0], (base[1] + bits[1]) % side, (base[2] + bits[2]) % side]
    return result


def read_periodic(image, x, y):
    """Returns a periodic image `[row, column]` or `[row, column, channel]` at places in tile widths, bilinearly."""
    side = image.shape[0]
    column, row = x * side - 0.5, (1 - y) * side - 0.5
    left, top = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    column_part, row_part = (column - left).astype(np.float32), (row - top).astype(np.float32)
    if image.ndim == 3:
        column_part, row_part = column_part[:, None], row_part[:, None]
    left, right, top, bottom = left % side, (left + 1) % side, top % side, (top + 1) % side
    upper = image[top, left] * (1 - column_part) + image[top, right] * column_part
    lower = image[bottom, left] * (1 - column_part) + image[bottom, right] * column_part
    return upper * (1 - row_part) + lower * row_part
