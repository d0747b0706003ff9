"""What is read of an asset's file without decoding it, and where it lies."""

import os
import struct

import bpy


class AssetError(Exception):
    """One sentence that names the file and the remedy."""


#: Bytes of the header that are read: magic, version, ..., checksum (words 12 and 13).
_HEADER_BYTES = 56
_MAGIC = b"SPMM"


def absolute_path(path):
    """Returns the path of a property, which may be relative to the .blend file.

    Raises AssetError where no file is there.
    """
    absolute = os.path.abspath(bpy.path.abspath(path)) if path else ""
    if not os.path.isfile(absolute):
        raise AssetError(f"{absolute or 'the asset'} is not there: choose the .spmm file again")
    return absolute


def checksum_of(path):
    """Returns the checksum in an asset's header, 16 hexadecimal digits.

    Raises AssetError for what is no packed asset.
    """
    try:
        with open(path, "rb") as file:
            head = file.read(_HEADER_BYTES)
    except OSError as error:
        raise AssetError(f"{path} cannot be read ({error.strerror}): check its permissions") from error
    if len(head) < _HEADER_BYTES or not head.startswith(_MAGIC):
        raise AssetError(f"{path} is no packed asset: make one with `btf-fit fit CAPTURE -o ASSET.spmm`")
    low, high = struct.unpack_from("<II", head, 48)
    return f"{high:08x}{low:08x}"


def open_asset(path):
    """Opens an asset with all its levels at hand in the file.

    Raises AssetError for a file that is no whole asset, and where the module `btf` is not installed.
    """
    try:
        import btf
    except ImportError as error:
        raise AssetError("the Python module btf is missing: install the extension from its .zip file") from error
    try:
        return btf.open(path)
    except (OSError, ValueError) as error:
        raise AssetError(str(error)) from error
