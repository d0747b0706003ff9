"""Nodes of a Principled BSDF that has an asset's fitted OpenPBR Surface.

Principled knows most of OpenPBR. What differs is turned here: its anisotropy is a number of another scale, its gloss has a
level in place of a weight. Its coat has no anisotropy, and what comes through a thin wall is a translucent shader beside it.
"""

import bpy

from .fitted_textures import COLOURS

#: Index of refraction of the base, and its reflectance at normal incidence: a level of 0.5 leaves it.
_BASE_IOR = 3.0
_BASE_F0 = 0.25
_COAT_IOR = 1.5
#: Mean length of light's way through the coat, thicknesses.
_MEAN_WAY = 1.13
#: Names of the nodes that the material's settings change.
MAPPING, HEIGHTS = "BTF size", "BTF heights"


class _Graph:
    """Adds nodes to a tree in columns from left to right."""

    def __init__(self, tree):
        self.tree, self._places = tree, {}

    def node(self, kind, column, **settings):
        node = self.tree.nodes.new(kind)
        row = self._places.get(column, 0)
        self._places[column] = row + 1
        node.location = (240.0 * column, -300.0 * row)
        for name, value in settings.items():
            setattr(node, name, value)
        return node

    def link(self, output, socket):
        self.tree.links.new(output, socket)

    def math(self, operation, column, *operands, clamp=False):
        """Adds a computation; operands are outputs or numbers. Returns its output."""
        node = self.node("ShaderNodeMath", column, operation=operation, use_clamp=clamp, hide=True)
        for socket, operand in zip(node.inputs, operands):
            if isinstance(operand, (int, float)):
                socket.default_value = operand
            else:
                self.link(operand, socket)
        return node.outputs[0]

    def vector_math(self, operation, column, *operands):
        """Adds a computation of vectors or colours; operands are outputs or one number for all channels."""
        node = self.node("ShaderNodeVectorMath", column, operation=operation, hide=True)
        for socket, operand in zip(node.inputs, operands):
            if isinstance(operand, (int, float)):
                socket.default_value = (operand,) * 3
            else:
                self.link(operand, socket)
        return node.outputs[0]


class _Textures:
    """The textures, each as an image node at the asset's coordinates."""

    def __init__(self, graph, paths, coordinates):
        self._graph, self._paths, self._coordinates = graph, paths, coordinates

    def __contains__(self, name):
        return name in self._paths

    def colour(self, name):
        image = bpy.data.images.load(self._paths[name], check_existing=True)
        # A texture that was fitted anew has the same name.
        image.reload()
        image.colorspace_settings.name = "sRGB" if name in COLOURS else "Non-Color"
        node = self._graph.node("ShaderNodeTexImage", -4, image=image, extension="REPEAT", label=name)
        self._graph.link(self._coordinates, node.inputs["Vector"])
        return node.outputs["Color"]

    def channels(self, name):
        split = self._graph.node("ShaderNodeSeparateColor", -3, hide=True)
        self._graph.link(self.colour(name), split.inputs[0])
        return split.outputs

    def normal(self, name):
        node = self._graph.node("ShaderNodeNormalMap", -1)
        self._graph.link(self.colour(name), node.inputs["Color"])
        return node.outputs["Normal"]


def _strength_and_turns(graph, x, y):
    """Of an anisotropy as the textures have it, returns the strength of OpenPBR and the turn of the long axis."""
    x, y = (graph.math("MULTIPLY_ADD", -3, channel, 2.0, -1.0) for channel in (x, y))
    squares = graph.math("ADD", -2, graph.math("MULTIPLY", -3, x, x), graph.math("MULTIPLY", -3, y, y))
    strength = graph.math("SQRT", -2, squares, clamp=True)
    # Twice the angle is stored; Principled takes whole turns.
    turns = graph.math("DIVIDE", -2, graph.math("ARCTAN2", -2, y, x), 4.0 * 3.141592653589793)
    return strength, turns


def _mean_roughness(graph, roughness, strength):
    """Returns the roughness whose square is the geometric mean of the widths along both axes [OpenPBR 1.1]."""
    rest = graph.math("SUBTRACT", -2, 1.0, strength)
    width = graph.math("MULTIPLY_ADD", -2, rest, rest, 1.0)
    ratio = graph.math("DIVIDE", -2, graph.math("MULTIPLY", -2, rest, 2.0), width)
    return graph.math("MULTIPLY", -1, roughness, graph.math("POWER", -1, ratio, 0.25))


def _seen_roughness(graph, roughness, coat_roughness, coat):
    """Returns the roughness of a base that is seen through a coat [OpenPBR 1.1, "Roughening"], which Principled leaves."""
    fourth = graph.math("POWER", -2, roughness, 4.0)
    both = graph.math("MULTIPLY_ADD", -2, graph.math("POWER", -2, coat_roughness, 4.0), 2.0, fourth)
    seen = graph.math("POWER", -2, graph.math("MINIMUM", -2, both, 1.0), 0.25)
    return graph.math("MULTIPLY_ADD", -2, graph.math("SUBTRACT", -2, seen, roughness), coat, roughness)


def _kept_colour(graph, colour, tint, reflectance):
    """Returns the diffuse colour below a tinted gloss.

    OpenPBR's gloss takes from the base what it would reflect without its tint, Principled's what it reflects with it.
    """
    tinted = graph.vector_math("SCALE", -2, tint)
    graph.link(reflectance, tinted.node.inputs["Scale"])
    kept = graph.vector_math("SCALE", -2, colour)
    graph.link(graph.math("SUBTRACT", -2, 1.0, reflectance), kept.node.inputs["Scale"])
    return graph.vector_math("DIVIDE", -1, kept, graph.vector_math("SUBTRACT", -2, 1.0, tinted))


def _add_base(graph, shader, textures, roughness, coat):
    """Links the base; `coat` is None or the coat's weight."""
    specular = textures.channels("specular")
    reflectance = graph.math("MULTIPLY", -2, specular[2], specular[2])
    tint = textures.colour("specular_color")
    graph.link(_kept_colour(graph, textures.colour("base_color"), tint, reflectance), shader.inputs["Base Color"])
    graph.link(tint, shader.inputs["Specular Tint"])
    graph.link(textures.normal("normal"), shader.inputs["Normal"])
    strength, turns = _strength_and_turns(graph, specular[0], specular[1])
    seen = roughness[0] if coat is None else _seen_roughness(graph, roughness[0], roughness[2], coat)
    graph.link(_mean_roughness(graph, seen, strength), shader.inputs["Roughness"])
    graph.link(roughness[1], shader.inputs["Diffuse Roughness"])
    # Of Principled's scale 0.9 is OpenPBR's whole.
    graph.link(graph.math("DIVIDE", -1, strength, 0.9, clamp=True), shader.inputs["Anisotropic"])
    graph.link(turns, shader.inputs["Anisotropic Rotation"])
    tangent = graph.node("ShaderNodeTangent", -1, direction_type="UV_MAP")
    graph.link(tangent.outputs[0], shader.inputs["Tangent"])
    level = graph.math("MULTIPLY", -1, reflectance, 0.5 / _BASE_F0)
    graph.link(level, shader.inputs["Specular IOR Level"])
    shader.inputs["IOR"].default_value = _BASE_IOR


def _add_coat(graph, shader, textures, coat, roughness):
    strength, _ = _strength_and_turns(graph, coat[0], coat[1])
    graph.link(coat[2], shader.inputs["Coat Weight"])
    graph.link(_mean_roughness(graph, roughness, strength), shader.inputs["Coat Roughness"])
    # Principled's light goes through the coat on a slanted way.
    tint = graph.node("ShaderNodeGamma", -1)
    graph.link(textures.colour("coat_color"), tint.inputs["Color"])
    tint.inputs["Gamma"].default_value = 1.0 / _MEAN_WAY
    graph.link(tint.outputs[0], shader.inputs["Coat Tint"])
    graph.link(textures.normal("coat_normal"), shader.inputs["Coat Normal"])
    shader.inputs["Coat IOR"].default_value = _COAT_IOR


def _add_fuzz(graph, shader, textures):
    fuzz = textures.channels("fuzz")
    graph.link(fuzz[0], shader.inputs["Sheen Weight"])
    graph.link(fuzz[1], shader.inputs["Sheen Roughness"])
    graph.link(textures.colour("fuzz_color"), shader.inputs["Sheen Tint"])


def _with_transmission(graph, shader, textures):
    """Returns the shader with what comes through beside it."""
    through = graph.node("ShaderNodeBsdfTranslucent", 0)
    graph.link(textures.colour("subsurface_color"), through.inputs["Color"])
    mix = graph.node("ShaderNodeMixShader", 1)
    graph.link(textures.channels("subsurface_weight")[0], mix.inputs[0])
    graph.link(shader, mix.inputs[1])
    graph.link(through.outputs[0], mix.inputs[2])
    return mix.outputs[0]


def build(material, textures, colour, heights):
    """Replaces the nodes of a material.

    textures: paths by name, as of `fitted_textures`; without any the shader has the one `colour`, linear RGB.
    heights: an image with heights in metres, or None.
    """
    tree = material.node_tree
    tree.nodes.clear()
    graph = _Graph(tree)
    coordinates = graph.node("ShaderNodeTexCoord", -6)
    mapping = graph.node("ShaderNodeMapping", -5, name=MAPPING, label=MAPPING)
    graph.link(coordinates.outputs["UV"], mapping.inputs["Vector"])
    shader = graph.node("ShaderNodeBsdfPrincipled", 0)
    output = graph.node("ShaderNodeOutputMaterial", 2)
    shaded = shader.outputs[0]
    if textures:
        images = _Textures(graph, textures, mapping.outputs[0])
        roughness = images.channels("roughness")
        coat = images.channels("coat") if "coat" in images else None
        _add_base(graph, shader, images, roughness, coat[2] if coat else None)
        if coat:
            _add_coat(graph, shader, images, coat, roughness[2])
        if "fuzz" in images:
            _add_fuzz(graph, shader, images)
        if "subsurface_color" in images:
            shaded = _with_transmission(graph, shaded, images)
    else:
        shader.inputs["Base Color"].default_value = (*colour, 1.0)
        shader.inputs["Roughness"].default_value = 1.0
        shader.inputs["Specular IOR Level"].default_value = 0.0
    graph.link(shaded, output.inputs["Surface"])
    if heights is not None:
        image = graph.node("ShaderNodeTexImage", -4, image=heights, extension="REPEAT", label="heights")
        graph.link(mapping.outputs[0], image.inputs["Vector"])
        displacement = graph.node("ShaderNodeDisplacement", 1, name=HEIGHTS, label=HEIGHTS)
        displacement.inputs["Midlevel"].default_value = 0.0
        graph.link(image.outputs["Color"], displacement.inputs["Height"])
        graph.link(displacement.outputs[0], output.inputs["Displacement"])
        # The normals of the relief are in the normal texture already, so no bumps.
        material.displacement_method = "DISPLACEMENT"
