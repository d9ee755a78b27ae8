"""Writes the type stubs of the package, __init__.pyi, filter.pyi and make.pyi, from its functions and the registry behind
them: PYTHONPATH=build/python python3 libvkt/python/stubs.py. With --check it says which of them are not current instead.
"""
# SPDX-License-Identifier: MIT
import difflib
import inspect
import pathlib
import re
import sys
import typing

sys.path.pop(0)  # the sources beside this script, which have no library
import vkt  # noqa: E402

HEAD = "# Written by libvkt/python/stubs.py from the registry; do not edit.\n# SPDX-License-Identifier: MIT\n"
IMPORTS = """import os
from typing import Any, Iterable, Iterator, Literal, Mapping, Sequence, SupportsFloat, SupportsIndex, overload

import numpy as np

"""


def annotation(value):
    if value is inspect.Parameter.empty:
        return None
    text = value.replace('"', "") if isinstance(value, str) else inspect.formatannotation(value)
    text = re.sub(r"\bvkt\.(?=[A-Z])", "", text.replace("numpy.ndarray", "np.ndarray"))
    text = re.sub(r"(?<![\w.])slice\b", "builtins.slice", text)  # slice() is an operation
    return text.replace("np.ndarray", "Array").replace("numpy.dtype", "np.dtype[Any]")


def typed(text):
    """The type of an option, as wide as what it takes: numbers of NumPy and its arrays, too."""
    for what, numbers in ("float", "Numbers"), ("int", "Integers"):
        text = re.sub(rf"Sequence\[{what}\]", numbers, text)
    text = re.sub(r"(?<![\w\[])float\b", "SupportsFloat", text)
    text = re.sub(r"(?<![\w\[])int\b", "SupportsIndex", text)
    return text.replace("np.ndarray", "Array")


def returned(function):
    """What the function of an operation returns."""
    return "Volume" if inspect.signature(function).return_annotation is vkt.Volume else "dict[str, Any]"


def line_of(name, parameters, result, indent=""):
    one = f"{indent}def {name}({', '.join(parameters)}) -> {result}: ..."
    if len(one) <= 120:
        return one
    lines = [""]
    for parameter in parameters:
        if len(lines[-1]) + len(parameter) > 112 - len(indent):
            lines.append("")
        lines[-1] += f"{' ' if lines[-1] else ''}{parameter},"
    body = "".join(f"{indent}    {line}\n" for line in lines)
    return f"{indent}def {name}(\n{body}{indent}) -> {result}: ..."


def picture_stub(first, indent=""):
    """Of render(), whose format says what comes back."""
    return "\n".join(f"{indent}@overload\n{indent}def render({first}, *, format: {format}, **options: Any) -> {result}: ..."
                     for format, result in (("Literal['uint8', 'float'] = 'uint8'", "Array"), ("Literal['png']", "bytes")))


def stub(function, name=None, indent=""):
    forms = [one_stub(form, name, indent) for form in typing.get_overloads(function)] or [one_stub(function, name, indent)]
    forms += [one_stub(function, name, indent, alias) for alias in getattr(function, "spelled", ())]
    return "\n".join(f"{indent}@overload\n{form}" for form in forms) if len(forms) > 1 else forms[0]


def one_stub(function, name, indent, alias=None):
    """`alias`: another name of an argument, as which it is given by name."""
    if function.__name__ == "render":
        return picture_stub("self" if indent else "volume: Volume", indent)
    signature = inspect.signature(function)
    texts = getattr(function, "texts", {})
    parameters, starred = [], False
    for parameter in signature.parameters.values():
        text = parameter.name
        if alias and function.spelled[alias] == parameter.name:
            parameters.append("*")
            text, starred = alias, True
        if parameter.kind is parameter.VAR_POSITIONAL:
            text, starred = "*" + text, True
        elif parameter.kind is parameter.VAR_KEYWORD:
            text = "**" + text
        elif parameter.kind is parameter.KEYWORD_ONLY and not starred:
            parameters.append("*")
            starred = True
        kind = typed(texts[parameter.name]) if parameter.name in texts else annotation(parameter.annotation)
        if kind:
            text += f": {kind}"
        if parameter.default is not parameter.empty:
            text += f" = {parameter.default!r}" if kind else f"={parameter.default!r}"
        parameters.append(text)
    result = returned(function) if texts else annotation(signature.return_annotation) or "None"
    return line_of(name or function.__name__, parameters, result, indent)


def class_stub(cls):
    lines = [f"class {cls.__name__}{'(Exception)' if issubclass(cls, Exception) else ''}:"]
    for name, kind in cls.__dict__.get("__annotations__", {}).items():
        lines.append(f"    {name}: {kind if isinstance(kind, str) else kind.__name__}")
    for name, member in cls.__dict__.items():
        if isinstance(member, property) and not (name.startswith("_") and not name.startswith("__")):
            lines.append("    @property")
            lines.append(f"    def {name}(self) -> {annotation(inspect.signature(member.fget).return_annotation)}: ...")
        elif inspect.isfunction(member) and (not name.startswith("_") or name in (
                "__init__", "__len__", "__iter__", "__getitem__", "__dlpack__", "__dlpack_device__", "__copy__", "__deepcopy__", "__enter__", "__exit__",
                "_repr_html_")):
            lines.append(stub(member, name, "    "))
    return "\n".join(lines) + "\n"


def stubs():
    """The texts of the stubs by the names of their files."""
    files = {}
    for module in vkt.filter, vkt.make:
        name = module.__name__.split(".")[-1]
        lines = [stub(getattr(module, function)) for function in module.__all__]
        files[name + ".pyi"] = (HEAD + IMPORTS.replace("Iterable, Iterator, ", "").replace(", overload", "") +
                                "from . import Array, DType, Integers, Numbers, Region, Value, Volume\n\n" + "\n".join(lines) + "\n")
    classes = [class_stub(c) for c in (vkt.Error, vkt.Series, vkt.Surface, vkt.Volume, vkt.policy)]
    functions = sorted(name for name, value in vars(vkt).items()
                       if inspect.isfunction(value) and not name.startswith("_"))
    aliases = ("Array = np.ndarray[Any, np.dtype[Any]]\n"
               "Numbers = Sequence[SupportsFloat] | Array\nIntegers = Sequence[SupportsIndex] | Array\n"
               "Value = str | SupportsFloat | Numbers | os.PathLike[str]\nDType = str | type | np.dtype[Any]\n"
               "Region = str | Sequence[builtins.slice | SupportsIndex | Sequence[SupportsFloat | None]] | Array\n"
               "__version__: str\n")
    files["__init__.pyi"] = (HEAD + "import builtins\n" + IMPORTS.replace("import os\n", "import os\nimport subprocess\n") + "from . import filter as filter, make as make\n\n" + aliases + "\n" +
                             "\n".join(classes) + "\n" + "\n".join(stub(getattr(vkt, name)) for name in functions) + "\n")
    return files


def main(check):
    folder = pathlib.Path(__file__).resolve().parent / "vkt"
    stale = False
    for name, text in stubs().items():
        path = folder / name
        if not check:
            path.write_text(text)
            continue
        old = path.read_text() if path.exists() else ""
        if old != text:
            stale = True
            sys.stdout.writelines(difflib.unified_diff(old.splitlines(True), text.splitlines(True), name, "the registry"))
    if stale:
        sys.exit("stubs are not current: PYTHONPATH=build/python python3 libvkt/python/stubs.py")


if __name__ == "__main__":
    main("--check" in sys.argv[1:])
