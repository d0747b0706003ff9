"""Evaluates an asset with the Python module: `python btf_values.py ASSET RULE LEVEL < places > answers`.

Places are 8 float32 each (uv, wi, wo), answers 4 (value, density); RULE is fast or exact. All levels are made.
"""

import sys

import btf
import numpy as np

path, rule, level = sys.argv[1:]
places = np.frombuffer(sys.stdin.buffer.read(), np.float32).reshape(-1, 8)
asset = btf.open(path, levels="all")
arguments = (places[:, :2], places[:, 2:5], places[:, 5:])
keywords = {"interpolation": rule, "level": int(level)}
answers = np.column_stack([asset.eval(*arguments, **keywords), asset.pdf(*arguments, **keywords)])
sys.stdout.buffer.write(np.ascontiguousarray(answers, np.float32).tobytes())
