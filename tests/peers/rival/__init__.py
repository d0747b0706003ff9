"""Rival codecs of a bidirectional texture function: what our codec is measured against.

Everything here works on one array `[texel, view, light, channel]` of 8-bit gamma-encoded values. Bytes are counted
from arrays that are really quantised, and errors are of values that are really decoded from them.
"""
