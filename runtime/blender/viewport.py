"""Pictures of the viewport, drawn in a thread: first one sample, then more while nothing moves."""

import threading

from . import viewer
from .viewer import Viewer

#: By this factor each picture has more samples than the one before.
_MORE_SAMPLES = 4


class ViewportPictures:
    """Draws the newest view that was asked for. All methods but the thread's own are called by Blender's thread."""

    def __init__(self, ready):
        """ready: called by the thread when a picture is there or a sentence has changed."""
        self._ready = ready
        self._condition = threading.Condition()
        self._wanted, self._samples, self._ended = None, 1, False
        self._viewer, self._kind = None, None
        #: The newest picture, as of `viewer.cut`, and the sentence that says why there is none.
        self.picture, self.sentence = None, ""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def ask(self, request, view, program, backend, samples):
        """Asks for a view with up to `samples` samples, drawn by `program`. The same again changes nothing."""
        wanted = (request, view, program, backend, samples)
        with self._condition:
            if wanted != self._wanted:
                self._wanted, self._samples = wanted, 1
                self._condition.notify()

    def forget(self):
        """Forgets the picture: what it shows is not there any more."""
        with self._condition:
            self._wanted, self.picture, self.sentence = None, None, ""

    def close(self):
        """Ends the thread, and with it the process; does not wait for them."""
        with self._condition:
            self._ended = True
            self._condition.notify()

    def _has_ended(self):
        with self._condition:
            return self._ended

    def _next(self):
        """Waits for work. Returns what is wanted and with how many samples; None at the end."""
        with self._condition:
            while not self._ended and (self._wanted is None or self._samples > self._wanted[-1]):
                self._condition.wait()
            return None if self._ended else (self._wanted, self._samples)

    def _run(self):
        try:
            while (work := self._next()) is not None:
                self._draw(*work)
        finally:
            if self._viewer is not None:
                self._viewer.close()

    def _draw(self, wanted, samples):
        request, view, program, backend, most = wanted
        picture, sentence = None, ""
        try:
            process = self._process(program, backend)
            pixels = process.draw({**request, "frames": samples}, is_cancelled=self._has_ended)
            picture = viewer.cut(pixels, view.part)
        except Exception as error:  # noqa: BLE001, a thread that ended would leave the viewport as it is without a word
            sentence, samples = str(error), most
        with self._condition:
            if self._wanted is not wanted and sentence:
                # It was about something else.
                return
            if self._wanted is not None:
                self.sentence = sentence
                self.picture = self.picture if picture is None else picture
            if self._wanted is wanted:
                # Up to the number that was asked for, then no further.
                self._samples = most + 1 if samples >= most else min(samples * _MORE_SAMPLES, most)
            ended = self._ended
        if not ended:
            try:
                self._ready()
            except ReferenceError:
                # Who would draw it is gone.
                self.close()

    def _process(self, program, backend):
        kind = (program, backend)
        if self._viewer is None or not self._viewer.is_running() or self._kind != kind:
            if self._viewer is not None:
                self._viewer.close()
            self._viewer, self._kind = Viewer(program, backend), kind
        return self._viewer
