"""Writes phantom.raw: 96^3 bytes as a scanner would give them of a head, x fastest, the front at -y, blurred and with noise.

Air is 0, flesh 80, brain 90, bone 220: ellipsoids, set one over the other."""

import random

N = 96
FLESH, BRAIN, BONE, AIR = 80.0, 90.0, 220.0, 0.0
# Centre and half axes, in halves of the cube's side, and the number inside.
BODIES = [
    ((0.0, 0.0, 0.10), (0.66, 0.80, 0.80), FLESH),
    ((0.0, 0.05, 0.22), (0.60, 0.72, 0.64), BONE),
    ((0.0, -0.34, -0.28), (0.42, 0.40, 0.44), BONE),
    ((0.0, 0.07, 0.24), (0.53, 0.64, 0.56), BRAIN),
    ((0.0, -0.25, -0.40), (0.33, 0.33, 0.40), FLESH),
    ((-0.24, -0.68, 0.03), (0.17, 0.24, 0.15), FLESH),
    ((0.24, -0.68, 0.03), (0.17, 0.24, 0.15), FLESH),
    ((0.0, -0.74, -0.24), (0.09, 0.20, 0.14), AIR),
    ((0.0, 0.10, -0.72), (0.11, 0.13, 0.40), BONE),
    ((0.0, 0.10, -0.72), (0.05, 0.06, 0.50), FLESH),
]


def number(x, y, z):
    inside = 0.0
    for centre, half, value in BODIES:
        if sum(((a - c) / h) ** 2 for a, c, h in zip((x, y, z), centre, half)) < 1.0:
            inside = value
    # A row of teeth with gaps.
    if -0.58 < z < -0.42 and -0.75 < y < -0.45 and abs(x) < 0.28 and (x * x / 0.1 + (y + 0.45) ** 2 / 0.09) < 1.0:
        if (x * x / 0.07 + (y + 0.45) ** 2 / 0.06) > 1.0:
            inside = BONE if int((x + 1.0) * 26.0) % 3 else AIR
    return inside


def blurred(cells):
    """Mean of each cell and its six neighbours, as a scanner's beam has a width."""
    out = list(cells)
    for i in range(N * N + N + 1, N**3 - N * N - N - 1):
        around = cells[i - 1] + cells[i + 1] + cells[i - N] + cells[i + N] + cells[i - N * N] + cells[i + N * N]
        out[i] = 0.4 * cells[i] + 0.1 * around
    return out


def main():
    draw = random.Random(1)
    place = [(i + 0.5) / N * 2.0 - 1.0 for i in range(N)]
    cells = blurred([number(x, y, z) for z in place for y in place for x in place])
    with open("phantom.raw", "wb") as file:
        file.write(bytes(max(0, min(255, round(cell + draw.gauss(0.0, 4.0)))) for cell in cells))


main()
