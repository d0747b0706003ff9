"""The notebook runs from its first cell to its last, and its figures are near those that are saved in it."""

import re
import unittest
from pathlib import Path

try:
    import mitsuba
    import nbclient
    import nbformat

    # An ImportError as well, where there is no LLVM.
    mitsuba.set_variant("llvm_ad_rgb")
except ImportError as error:
    MISSING = str(error)
else:
    MISSING = ""

NOTEBOOK = Path(__file__).resolve().parents[1] / "examples" / "fit_and_render.ipynb"


def said(notebook):
    """The texts that the cells answer."""
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    return [output["data"]["text/plain"] for output in outputs if "text/plain" in output.get("data", {})]


@unittest.skipIf(MISSING, MISSING)
class Notebook(unittest.TestCase):
    def test_it_runs_and_its_decibels_are_those_that_are_saved(self):
        saved = nbformat.read(NOTEBOOK, as_version=4)
        fresh = nbformat.read(NOTEBOOK, as_version=4)
        nbclient.NotebookClient(fresh, timeout=600).execute()
        curves = [next(text for text in said(one) if re.fullmatch(r"\[[\d., ]+\]", text)) for one in (saved, fresh)]
        curves = [[float(word) for word in curve.strip("[]").split(",")] for curve in curves]
        self.assertEqual(len(curves[0]), 5)
        for before, now in zip(*curves):
            self.assertLess(abs(before - now), 0.3, curves)
        pictures = [o for cell in fresh.cells for o in cell.get("outputs", []) if "image/png" in o.get("data", {})]
        self.assertEqual(len(pictures), 3)


if __name__ == "__main__":
    unittest.main()
