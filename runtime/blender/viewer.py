"""The process `btf-view serve`, which draws: requests are lines of JSON, answers lines of JSON with pixels behind the last."""

import json
import os
import queue
import subprocess
import tempfile
import threading

import numpy as np

from . import programs


#: Time between two looks whether a picture is still wanted.
_PATIENCE_S = 0.1


class ViewerFault(Exception):
    """One sentence of the program, or about it."""


class Cancelled(Exception):
    """The picture was not wanted any more; the process has been ended."""


class Viewer:
    """One process. Its first picture of a scene takes as long as uploading it; others only their frames."""

    def __init__(self, program, backend="auto"):
        """Starts `btf-view` at a path. Raises ProgramError where it does not start."""
        try:
            self._errors = tempfile.TemporaryFile()
            self._process = subprocess.Popen(
                [program, "serve", "--backend", backend],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                creationflags=programs.NO_WINDOW,
            )
        except OSError as error:
            raise programs.ProgramError(f"{program} does not start ({error.strerror})") from error
        # Read by a thread, so that waiting for an answer can be given up.
        self._answers = queue.Queue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def is_running(self):
        return self._process.poll() is None

    def close(self):
        """Ends the process, in the middle of a picture if need be."""
        if self.is_running():
            self._process.kill()
        self._process.wait()
        self._reader.join(timeout=10.0)
        for pipe in (self._process.stdin, self._process.stdout, self._errors):
            try:
                pipe.close()
            except OSError:
                pass

    def draw(self, request, told=lambda kind, value: None, is_cancelled=lambda: False):
        """Draws a picture. Returns (rows, columns, 4) linear radiance, single precision, rows from the bottom up.

        told: called with "progress" and a share, or "note" and a sentence.
        is_cancelled: asked many times a second; the process ends with the picture then.
        Raises ViewerFault with the program's sentence, and Cancelled.
        """
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except (OSError, ValueError) as error:
            raise ViewerFault(self._last_words()) from error
        while True:
            if is_cancelled():
                self.close()
                raise Cancelled
            try:
                answer, pixels = self._answers.get(timeout=_PATIENCE_S)
            except queue.Empty:
                continue
            if answer is None:
                raise ViewerFault(self._last_words())
            if "error" in answer:
                raise ViewerFault(answer["error"])
            if pixels is not None:
                return pixels
            for kind, value in answer.items():
                told(kind, value)

    def _read(self):
        """Passes answers on until the process ends, at last (None, None)."""
        out = self._process.stdout
        try:
            for line in out:
                answer, pixels = json.loads(line), None
                if "bytes" in answer:
                    data = out.read(answer["bytes"])
                    pixels = np.frombuffer(data, "<f4").reshape(answer["height"], answer["width"], 4)
                self._answers.put((answer, pixels))
        except (OSError, ValueError):
            # Cut off in the middle.
            pass
        self._answers.put((None, None))

    def _last_words(self):
        """Returns what the process said before it ended."""
        try:
            self._process.wait(timeout=10.0)
            self._errors.seek(0)
            lines = self._errors.read().decode(errors="replace").strip().splitlines()
        except (OSError, ValueError, subprocess.TimeoutExpired):
            lines = []
        return lines[-1].removeprefix("error: ") if lines else "btf-view was ended while it drew"


def cut(pixels, part):
    """Returns the wanted part of a picture: x, y, width, height from the lower left corner."""
    x, y, width, height = part
    return np.ascontiguousarray(pixels[y : y + height, x : x + width])


def scene_folder():
    """Makes a temporary folder for a scene; it is removed when the object is."""
    return tempfile.TemporaryDirectory(prefix="btf_blender_")


def request_of(exported, view, lamps, settings, frames):
    """Returns the request for a picture of an exported scene.

    settings: `engine_settings.BtfRenderSettings`.
    """
    return {
        "scene": os.path.abspath(exported.path),
        "view": {"camera": view.camera, **lamps, **exported.world.view()},
        "size": list(view.size),
        "frames": frames,
        "mode": settings.mode.lower(),
        "depth": settings.depth,
    }
