"""From Blender's axes, z up, to those of glTF and `btf-view`, y up."""

from mathutils import Matrix

#: (x, y, z) becomes (x, z, -y).
Y_UP = Matrix(((1, 0, 0, 0), (0, 0, 1, 0), (0, -1, 0, 0), (0, 0, 0, 1)))


def y_up(vector):
    """Returns a vector of Blender's as a list in the other axes."""
    x, y, z = vector
    return [x, z, -y]
