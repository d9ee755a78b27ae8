"""Filters as functions: vkt.filter.gaussian(volume, sigma=2). Made from the registry of the library."""
# SPDX-License-Identifier: MIT
from ._operations import functions as _functions

globals().update(_functions(["filter"], __name__))
__all__ = sorted(name for name in globals() if not name.startswith("_"))
