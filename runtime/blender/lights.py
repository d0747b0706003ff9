"""Blender's lamps and world as `btf-view` takes them. Intensities are per steradian: a lamp of P watts has P / 4 pi."""

import math
import os

from mathutils import Vector

from . import named_files
from .axes import y_up

#: Distance at which a further sun stands as a lamp, scene units.
_FAR = 1e4
#: Names of the colour spaces in which pictures of light are taken as they are.
_LINEAR = {"Linear Rec.709", "Non-Color", "Linear"}
#: Inputs of a Mapping node.
_MAPPED = ("Location", "Rotation", "Scale")
#: Farther than everything occludes.
_NO_END = 1e30


def _colour(light):
    """Returns the light's power in each channel, with exposure and temperature."""
    power = light.energy * 2.0 ** getattr(light, "exposure", 0.0)
    colour = [power * channel for channel in light.color]
    if getattr(light, "use_temperature", False):
        colour = [channel * factor for channel, factor in zip(colour, light.temperature_color)]
    return colour


def lamps(depsgraph):
    """Returns the keys `lights` and, where there is one, `sun` of a request, and sentences about what is left out."""
    points, suns, left_out = [], [], []
    for instance in depsgraph.object_instances:
        obj = instance.object
        if obj.type != "LIGHT" or not instance.show_self:
            continue
        light, place = obj.data, instance.matrix_world
        if not getattr(light, "normalize", True):
            left_out.append(f"{obj.name} is not normalized by its size, so it is drawn with another power")
        if light.type == "POINT":
            intensity = [channel / (4.0 * math.pi) for channel in _colour(light)]
            points.append({"position": y_up(place.translation), "intensity": intensity})
        elif light.type == "SUN":
            towards = (place.to_3x3() @ Vector((0.0, 0.0, 1.0))).normalized()
            suns.append((towards, _colour(light), math.degrees(light.angle)))
        else:
            left_out.append(f"{obj.name} is no point or sun, so it is left out")
    told = {}
    # The widest has soft shadows; any more are lamps far away.
    suns.sort(key=lambda sun: -sun[2])
    for number, (towards, irradiance, angle_deg) in enumerate(suns):
        if number == 0:
            told["sun"] = {
                "direction": y_up(towards),
                "irradiance": irradiance,
                "angular_diameter_deg": min(angle_deg, 90.0),
            }
        else:
            intensity = [channel * _FAR * _FAR for channel in irradiance]
            points.append({"position": y_up(towards * _FAR), "intensity": intensity})
    told["lights"] = points
    return told, left_out


class World:
    """The light from all around: one colour, or a picture."""

    def __init__(self, radiance=(0.0, 0.0, 0.0)):
        self.radiance, self.picture, self.gain, self.turn_deg, self.left_out = list(radiance), None, 1.0, 0.0, []

    def view(self):
        """Returns the keys of a request."""
        if self.picture:
            return {}
        told = {"background": self.radiance}
        if any(self.radiance):
            told["ambient"] = {"radiance": self.radiance, "distance": _NO_END}
        return told


def _source(socket, kind):
    """Returns the node of a kind that feeds a socket, or None."""
    node = socket.links[0].from_node if socket.is_linked else None
    return node if node is not None and node.bl_idname == kind else None


def world_of(world, folder):
    """Returns the World of Blender's; a picture that is packed in the .blend file is written into `folder`."""
    if world is None:
        return World()
    tree = world.node_tree
    output = tree.get_output_node("ALL") if tree else None
    if output is None:
        return World(world.color)
    background = _source(output.inputs["Surface"], "ShaderNodeBackground")
    if background is None:
        told = World()
        if output.inputs["Surface"].is_linked:
            told.left_out.append("the world has no Background node, so it is dark")
        return told
    strength = background.inputs["Strength"].default_value
    colour = background.inputs["Color"]
    if not colour.is_linked:
        return World([strength * channel for channel in colour.default_value[:3]])
    told = World()
    if background.inputs["Strength"].is_linked:
        told.left_out.append("the world's strength is computed by nodes, which are not followed")
    if strength <= 0.0:
        return told
    texture = _source(colour, "ShaderNodeTexEnvironment")
    if texture is None or texture.image is None or texture.projection != "EQUIRECTANGULAR":
        told.left_out.append("the world's colour is no equirectangular picture, so it is dark")
        return told
    path = _picture_file(texture.image, folder)
    if path is None:
        told.left_out.append(f"{texture.image.name} is no .exr or .hdr picture that is there, so the world is dark")
        return told
    if texture.image.colorspace_settings.name not in _LINEAR:
        told.left_out.append(f"the colours of {texture.image.name} are not Linear Rec.709, so the world is dark")
        return told
    mapping = _source(texture.inputs["Vector"], "ShaderNodeMapping")
    turn = _turn_deg(mapping, told.left_out) if mapping else 0.0
    # The middle of Blender's pictures is +x, which is +x here, too; that of ours -z.
    told.picture, told.gain, told.turn_deg = path, strength, -90.0 - turn
    return told


def _turn_deg(mapping, left_out):
    """Returns by how much a Mapping node turns about z, and tells what else it does."""
    values = [tuple(mapping.inputs[name].default_value) if name in mapping.inputs else None for name in _MAPPED]
    location, rotation, scale = values
    others = [rotation[:2] != (0.0, 0.0), scale != (1.0, 1.0, 1.0), location not in (None, (0.0, 0.0, 0.0))]
    if any(others) or any(mapping.inputs[name].is_linked for name in _MAPPED if name in mapping.inputs):
        left_out.append("of the world's mapping only the turn about z is followed")
    turn = math.degrees(rotation[2])
    return -turn if mapping.vector_type == "TEXTURE" else turn


def _picture_file(image, folder):
    """Returns the path of an .exr or .hdr file with an image's pixels, or None."""
    path = os.path.abspath(image.filepath_from_user())
    extension = os.path.splitext(path)[1].lower()
    if extension not in (".exr", ".hdr"):
        return None
    if image.packed_file is None:
        return path if os.path.isfile(path) else None
    return os.path.join(folder, named_files.write(folder, "world", extension, image.packed_file.data))
