"""The textures of an asset's OpenPBR Surface, which `btf-fit export-mtlx` fits and writes beside a document."""

import json
import os
import subprocess
from xml.etree import ElementTree

from . import programs
from .asset_file import AssetError, checksum_of

#: Textures whose colours are sRGB; the others hold numbers.
COLOURS = ("base_color", "specular_color", "coat_color", "fuzz_color", "subsurface_color")
#: Textures that every document has, and those that some have.
ALWAYS = ("base_color", "specular_color", "normal", "roughness", "specular")
SOMETIMES = ("coat_color", "coat_normal", "coat", "fuzz_color", "fuzz", "subsurface_color", "subsurface_weight")


def document_beside(asset, folder=""):
    """Returns the path of the document with the asset's textures: beside the asset, or in another folder."""
    stem = os.path.splitext(os.path.basename(asset))[0]
    return os.path.join(folder or os.path.dirname(asset), stem + ".mtlx")


def textures_of(document):
    """Returns the textures that lie beside a document, by name."""
    stem = os.path.splitext(document)[0]
    paths = {name: f"{stem}_{name}.png" for name in ALWAYS + SOMETIMES}
    # Others may be left from an earlier fit.
    used = {entry.get("value") for entry in ElementTree.parse(document).iter("input")}
    return {name: path for name, path in paths.items() if os.path.isfile(path) and os.path.basename(path) in used}


def is_current(document, asset):
    """Tells whether a document with all its textures is there that was made of this very asset."""
    try:
        root = ElementTree.parse(document).getroot()
    except (OSError, ElementTree.ParseError):
        return False
    material = root.find("surfacematerial")
    made_of = material.get("btf_checksum") if material is not None else None
    return made_of == checksum_of(asset) and all(name in textures_of(document) for name in ALWAYS)


class Fit:
    """A run of `btf-fit export-mtlx`, which takes minutes for 256 x 256 texels."""

    def __init__(self, asset, document):
        """Starts it. Raises ProgramError where the program is missing or does not start."""
        program = programs.find("btf-fit")
        command = [program, "export-mtlx", asset, "-o", document, "--json", "-", "--quiet"]
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                creationflags=programs.NO_WINDOW,
            )
        except OSError as error:
            raise programs.ProgramError(f"{program} does not start ({error.strerror})") from error

    def is_running(self):
        return self._process.poll() is None

    def cancel(self):
        """Ends it; nothing half written stays."""
        self._process.terminate()
        self._process.communicate()

    def result(self):
        """Waits for the end and returns the PSNR of the material against the asset, dB.

        Raises AssetError with the program's own sentence.
        """
        out, sentence = self._process.communicate()
        if self._process.returncode != 0:
            words = sentence.strip().splitlines()
            raise AssetError(words[-1].removeprefix("error: ") if words else "btf-fit was ended")
        return float(json.loads(out)["psnr_db"])
