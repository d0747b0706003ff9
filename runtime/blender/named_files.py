"""Files whose names tell their contents: what has changed has another name, and what is read does not change."""

import hashlib
import os
import tempfile


def write(folder, kind, extension, data):
    """Writes a file, whole or not at all. Returns its name."""
    name = f"{kind}_{hashlib.blake2b(data, digest_size=12).hexdigest()}{extension}"
    path = os.path.join(folder, name)
    if os.path.isfile(path):
        # The newest is the one in use.
        os.utime(path)
        return name
    with tempfile.NamedTemporaryFile(dir=folder, delete=False) as out:
        out.write(data)
    os.replace(out.name, path)
    return name


def remove_old(folder, kind, kept):
    """Removes all files of a kind but the newest."""
    paths = [os.path.join(folder, name) for name in os.listdir(folder) if name.startswith(kind + "_")]
    for path in sorted(paths, key=os.path.getmtime)[:-kept]:
        os.remove(path)
