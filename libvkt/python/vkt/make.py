"""Test volumes as functions: vkt.make.sphere(dims=(64, 64, 64)). Made from the registry of the library."""
# SPDX-License-Identifier: MIT
from ._operations import functions as _functions

globals().update(_functions(["make"], __name__))
__all__ = sorted(name for name in globals() if not name.startswith("_"))
