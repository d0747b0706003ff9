"""The process `btf-view serve`, which draws: requests are lines of JSON, answers lines of JSON with pixels behind the last."""

import json
import os
import subprocess
import tempfile
import threading

import numpy as np

from . import programs


class ViewerFault(Exception):
    """One sentence of the program, or about it."""


class Cancelled(Exception):
    """The picture was not wanted any more; the process has been ended."""


class Viewer:
    """One process. Its first picture of a scene takes as long as uploading it; others only their frames."""

    def __init__(self, backend="auto"):
        """Starts the process. Raises ProgramError where the program is missing."""
        program = programs.find("btf-view")
        self._errors = tempfile.TemporaryFile()
        try:
            self._process = subprocess.Popen(
                [program, "serve", "--backend", backend],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._errors,
            )
        except OSError as error:
            raise programs.ProgramError(f"{program} does not start ({error.strerror})") from error
        self._lock = threading.Lock()

    def is_running(self):
        return self._process.poll() is None

    def close(self):
        """Ends the process, in the middle of a picture if need be."""
        if self.is_running():
            self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout, self._errors):
            try:
                pipe.close()
            except OSError:
                pass

    def draw(self, request, told=lambda kind, value: None, is_cancelled=lambda: False):
        """Draws a picture. Returns (rows, columns, 4) linear radiance, single precision, rows from the bottom up.

        told: called with "progress" and a share, or "note" and a sentence.
        is_cancelled: asked while it draws, at each progress; the process ends with the picture then.
        Raises ViewerFault with the program's sentence, and Cancelled.
        """
        with self._lock:
            try:
                self._process.stdin.write(json.dumps(request).encode() + b"\n")
                self._process.stdin.flush()
                return self._answer(told, is_cancelled)
            except OSError as error:
                raise ViewerFault(self._last_words()) from error

    def _answer(self, told, is_cancelled):
        while True:
            line = self._process.stdout.readline()
            if not line:
                raise ViewerFault(self._last_words())
            answer = json.loads(line)
            if "error" in answer:
                raise ViewerFault(answer["error"])
            if "bytes" in answer:
                return self._pixels(answer)
            for kind, value in answer.items():
                told(kind, value)
            if is_cancelled():
                self.close()
                raise Cancelled

    def _pixels(self, answer):
        data = self._process.stdout.read(answer["bytes"])
        if len(data) < answer["bytes"]:
            raise ViewerFault(self._last_words())
        return np.frombuffer(data, "<f4").reshape(answer["height"], answer["width"], 4)

    def _last_words(self):
        """Returns what the process said before it ended."""
        self._process.wait()
        self._errors.seek(0)
        lines = self._errors.read().decode(errors="replace").strip().splitlines()
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
