"""The domain in which a codec works: gamma (the 8-bit values themselves), linear or log."""

import numpy as np

# Added before the logarithm; about one step of 8 bits in the darks.
LOG_EPS = 0.01


def linear_of(encoded, transfer="srgb"):
    """Linear values of gamma-encoded ones in 0..1."""
    if transfer.startswith("gamma:"):
        return np.maximum(encoded, 0) ** float(transfer[6:])
    if transfer == "linear":
        return encoded
    return np.where(encoded <= 0.04045, encoded / 12.92, ((np.maximum(encoded, 0.04045) + 0.055) / 1.055) ** 2.4)


def encoded_of(linear, transfer="srgb"):
    """Gamma-encoded values of linear ones."""
    if transfer.startswith("gamma:"):
        return np.maximum(linear, 0) ** (1 / float(transfer[6:]))
    if transfer == "linear":
        return linear
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055)


class Domain:
    """Maps 8-bit values to what is factored and back. Values are scaled so that steps are comparable to 8-bit steps."""

    def __init__(self, kind, transfer="srgb"):
        self.kind, self.transfer = kind, transfer
        code = np.arange(256) / 255
        table = {
            "gamma": lambda: np.arange(256.0),
            "linear": lambda: 255 * linear_of(code, transfer),
            "log": lambda: 50 * np.log(linear_of(code, transfer) + LOG_EPS),
        }[kind]()
        self.table = table.astype(np.float32)
        # Decoding to 8 bits: thresholds in the domain between codes k and k + 1, where the encoded value is k + 1/2.
        half = (np.arange(255) + 0.5) / 255
        self.thresholds = {
            "gamma": lambda: np.arange(255) + 0.5,
            "linear": lambda: 255 * linear_of(half, transfer),
            "log": lambda: 50 * np.log(linear_of(half, transfer) + LOG_EPS),
        }[kind]().astype(np.float32)
        # A fine inverse table, so that millions of values are decoded by one look-up; of the square root where steps
        # are crowded in the darks.
        self.root = kind == "linear"
        ends = self.table[[0, -1]].astype(np.float64)
        low, high = np.sqrt(ends) if self.root else ends
        self.low, self.steps = low, 65535 / (high - low)
        centres = low + np.arange(65536) / self.steps
        self.inverse = np.searchsorted(self.thresholds, centres**2 if self.root else centres).astype(np.float32)

    def forward(self, codes):
        """float32 domain values of 8-bit codes."""
        return codes.astype(np.float32) if self.kind == "gamma" else self.table[codes]

    def codes(self, values):
        """Decoded 8-bit values, as float32; overwrites `values`."""
        if self.kind == "gamma":
            np.rint(values, out=values)
            return np.clip(values, 0, 255, out=values)
        if self.root:
            np.sqrt(np.maximum(values, 0, out=values), out=values)
        values -= np.float32(self.low)
        values *= np.float32(self.steps)
        values += np.float32(0.5)
        np.clip(values, 0, 65535, out=values)
        return self.inverse[values.astype(np.uint16)]

    def to_linear(self, values):
        """Linear values (1.0 = white) of domain values, not clipped above."""
        if self.kind == "gamma":
            return linear_of(np.clip(values / 255, 0, None), self.transfer)
        if self.kind == "linear":
            return np.maximum(values / 255, 0)
        return np.maximum(np.exp(values / 50) - LOG_EPS, 0)


def squared_error(decoded, codes):
    """Sum of squares of decoded minus measured 8-bit values; overwrites `decoded`."""
    decoded -= codes
    flat = decoded.reshape(-1)
    return float(np.dot(flat, flat))


def psnr_db(sum_of_squares, count):
    """Peak signal-to-noise ratio of 8-bit values; 99 for no error."""
    return 99.0 if sum_of_squares <= 0 else float(10 * np.log10(255.0**2 * count / sum_of_squares))
