"""Pictures of the viewport, drawn in a thread: first one sample, then more while nothing moves."""

import threading

from . import viewer
from .programs import ProgramError
from .viewer import Cancelled, Viewer, ViewerFault

#: By this factor each picture has more samples than the one before.
_MORE_SAMPLES = 4


class ViewportPictures:
    """Draws the newest view that was asked for. All methods but the thread's own are called by Blender's thread."""

    def __init__(self, ready):
        """ready: called by the thread when a picture is there or a sentence has changed."""
        self._ready = ready
        self._condition = threading.Condition()
        self._wanted, self._samples, self._ended = None, 1, False
        self._viewer, self._backend = None, None
        #: The newest picture, `(pixels, view)`, and the sentence that says why there is none.
        self.picture, self.sentence = None, ""
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def ask(self, request, view, backend, samples):
        """Asks for a view with up to `samples` samples. The same again changes nothing."""
        wanted = (request, view, backend, samples)
        with self._condition:
            if wanted != self._wanted:
                self._wanted, self._samples = wanted, 1
                self._condition.notify()

    def close(self):
        """Ends the thread and the process."""
        with self._condition:
            self._ended = True
            self._condition.notify()
        if self._viewer is not None:
            self._viewer.close()
        self._thread.join(timeout=10.0)

    def _next(self):
        """Waits for work. Returns what is wanted and with how many samples; None at the end."""
        with self._condition:
            while not self._ended and (self._wanted is None or self._samples > self._wanted[3]):
                self._condition.wait()
            return None if self._ended else (self._wanted, self._samples)

    def _run(self):
        while (work := self._next()) is not None:
            wanted, samples = work
            request, view, backend, most = wanted
            try:
                pixels = self._process(backend).draw({**request, "frames": samples})
                self.picture, self.sentence = (viewer.cut(pixels, view.part), view), ""
            except (ViewerFault, ProgramError, Cancelled, ValueError) as error:
                self.sentence, samples = str(error), most
            with self._condition:
                if self._wanted is wanted:
                    # Up to the number that was asked for, then no further.
                    self._samples = most + 1 if samples >= most else min(samples * _MORE_SAMPLES, most)
                ended = self._ended
            if not ended:
                self._ready()

    def _process(self, backend):
        if self._viewer is None or not self._viewer.is_running() or self._backend != backend:
            if self._viewer is not None:
                self._viewer.close()
            self._viewer, self._backend = Viewer(backend), backend
        return self._viewer
