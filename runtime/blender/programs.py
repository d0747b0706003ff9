"""Finds the programs `btf-fit` and `btf-view`: those of the preferences, those packed with the add-on, those of the PATH."""

import os
import shutil
import subprocess

import bpy

#: On Windows a program without a window opens no console.
NO_WINDOW = getattr(subprocess, "CREATE_NO_WINDOW", 0)
#: Programs packed with the add-on lie here.
PACKED = os.path.join(os.path.dirname(__file__), "bin")


class ProgramError(Exception):
    """One sentence that names the program and the remedy."""


class BtfPreferences(bpy.types.AddonPreferences):
    """Where the programs lie, where they are neither packed with the add-on nor on the PATH."""

    bl_idname = __package__

    btf_fit: bpy.props.StringProperty(
        name="btf-fit", subtype="FILE_PATH", description="Fits textures; empty for the one of the add-on or the PATH"
    )
    btf_view: bpy.props.StringProperty(
        name="btf-view", subtype="FILE_PATH", description="Draws pictures; empty for the one of the add-on or the PATH"
    )

    def draw(self, _context):
        self.layout.prop(self, "btf_fit")
        self.layout.prop(self, "btf_view")


def find(name):
    """Returns the path of `btf-fit` or `btf-view`.

    Raises ProgramError where there is none.
    """
    addon = bpy.context.preferences.addons.get(__package__)
    named = getattr(addon.preferences, name.replace("-", "_"), "") if addon and addon.preferences else ""
    if named:
        named = bpy.path.abspath(named)
        if not os.path.isfile(named):
            raise ProgramError(f"{named} is not there: correct the path of {name} in the add-on's preferences")
        return named
    suffix = ".exe" if os.name == "nt" else ""
    packed = os.path.join(PACKED, name + suffix)
    if os.path.isfile(packed):
        # Unpacked archives have lost the right to run.
        if not os.access(packed, os.X_OK):
            os.chmod(packed, 0o755)
        return packed
    found = shutil.which(name)
    if not found:
        raise ProgramError(f"{name} was not found: name it in the add-on's preferences, or put it on the PATH")
    return found


CLASSES = (BtfPreferences,)
