"""Operations: by name and words, and as functions whose signatures and help are those of the library's registry."""
# SPDX-License-Identifier: MIT
import atexit
import ctypes
import functools
import inspect
import json
import keyword
import os
import shlex
import sys
import textwrap
import threading
import time
import typing
import warnings
from typing import Any, Literal, Mapping, Sequence  # noqa: F401  what annotations name

import numpy as np

from ._library import Error, VoxelFunction, check, library, option_words, text_of, value_word, words_of

# What options without a kind of their own take: "50%", 0.5, (1, 2, 3), a path.
Value = typing.Union[str, float, Sequence[float], os.PathLike]
Region = typing.Union[str, Sequence[typing.Union[slice, int, Sequence[typing.Optional[float]]]]]  # x, y and z
DType = typing.Union[str, type, np.dtype]


def operations() -> "list[str]":
    """Names of the operations that apply() knows."""
    return sorted(_names())


@functools.lru_cache(maxsize=None)
def _names():
    pointer, names = library.vkt_operations(), []
    while pointer[len(names)] is not None:
        names.append(pointer[len(names)].decode())
    return frozenset(names)


@functools.lru_cache(maxsize=None)
def registered(name):
    """What the registry says of an operation (libvkt/engine/operation_help.h)."""
    return json.loads(text_of(library.vkt_operation_help, name.encode()))


def _volume_class():
    from ._volume import Volume
    return Volume


def apply(name: str, *arguments: Any, **options: Any) -> Any:
    """The result of an operation: apply("filter gaussian", volume, sigma=2), apply("flip x", volume),
    apply("arith sub", a, b), apply("make sphere", dims=(64, 64, 64)).

    Operations that make no volume return what they report, as the command prints it with --json: a dict, apply("stats",
    volume, percentiles=50)["p50"], apply("diff", a, b, ssim=True)["ssim"]; of several volumes a list of these. Options
    that name volumes are given as words and volumes: apply("stats", volume, "--labels", labels)["labels"].

    Arguments are volumes and words, in the order of the command line; an option that names a volume takes one by name,
    too: apply("resample", volume, like=other). What was lost on the way, such as values that
    were clipped, is a warning."""
    return apply_words(name, arguments, options)


def apply_words(name, arguments, options):
    words, inputs, volume_class = shlex.split(name), [], _volume_class()
    for argument in arguments:
        if isinstance(argument, volume_class):
            inputs.append(argument)
            words.append("-")
        else:
            words.append(value_word(argument))
    for key, value in options.items():
        if isinstance(value, volume_class):
            inputs.append(value)
            words += ["--" + key.rstrip("_").replace("_", "-"), "-"]
        else:
            words += option_words({key: value})
    return applied(name, words, inputs)


def applied(name, words, inputs, level=5, operation=None):
    handles = (ctypes.c_void_p * len(inputs))(*(volume._handle for volume in inputs))
    if operation is None:
        said = next((said for said in (" ".join(words[:n]) for n in (1, 2)) if said in _names()), None)
        operation = registered(said) if said else {"result": "volume"}
    if operation["result"] == "report":
        return json.loads(text_of(library.vkt_measure, *words_of(words), handles, len(inputs)))
    handle = ctypes.c_void_p()
    check(library.vkt_apply(*words_of(words), handles, len(inputs), ctypes.byref(handle)))
    return _result(name, handle, level)


def _result(name, handle, level):
    """The volume; what was lost is a warning for whoever called the package, so many calls up."""
    result = _volume_class()._of(handle)
    for remark in library.vkt_remarks(handle).decode().splitlines():
        warnings.warn(f"{name}: {remark}", RuntimeWarning, stacklevel=level)
    return result


def transform(volume: "Volume", what: Any, *others: "Volume", **options: Any) -> "Volume":
    """Every voxel computed: transform(volume, "v * 2 + sin(x / 10)"), transform(volume, "a > v ? a : v", other), or with
    a function of index and value, transform(volume, lambda x, y, z, value: value if z > 10 else 0).

    An expression is that of `vkt transform` (man vkt-transform); others are its volumes a, b, …; options: dtype, roi,
    boundary. A function is called once for every voxel, in the order of memory, and is slower by a factor of hundreds;
    its options are dtype and roi. What it raises stops it and comes out here."""
    return transformed(volume, what, others, options)


class _Unraisable:
    """Catches what a signal raises as the interpreter enters a function of a voxel, where no "try" holds yet. Several
    threads share the hook of the interpreter, which is put back when the last of them is done."""
    _lock, _running, _before = threading.Lock(), {}, None

    def __init__(self, function, raised):
        self._function, self._raised = function, raised

    def __enter__(self):
        with self._lock:
            if not self._running:
                _Unraisable._before, sys.unraisablehook = sys.unraisablehook, self._hook
            self._running[id(self._function)] = self._raised

    def __exit__(self, *_):
        with self._lock:
            del self._running[id(self._function)]
            if not self._running:
                sys.unraisablehook = _Unraisable._before

    @classmethod
    def end(cls):
        """Before the interpreter ends: a thread that asked for it from inside of the library would be torn out of it."""
        with cls._lock:
            for raised in cls._running.values():
                raised.append(SystemExit())
        last = time.monotonic() + 5
        while cls._running and time.monotonic() < last:
            time.sleep(0.002)

    @classmethod
    def _hook(cls, lost):
        raised = cls._running.get(id(lost.object))
        if raised is None:
            cls._before(lost)
        else:
            raised.append(lost.exc_value)


atexit.register(_Unraisable.end)


def transformed(volume, what, others, options):
    if not callable(what):
        # A blank keeps an expression that begins with a dash from being an option.
        words = " " + what if what.startswith("-") else what
        return applied("transform", ["transform", words, *option_words(options)], [volume, *others])
    if others:
        raise Error("a function of index and value takes one volume", 2, "an expression takes several")
    raised = []

    def called(x, y, z, value, _):
        if raised:
            return 0.0
        try:
            return float(what(x, y, z, value))
        except BaseException as error:  # C cannot hand it on
            raised.append(error)
            return 0.0

    handle = ctypes.c_void_p()
    with _Unraisable(called, raised):
        status = library.vkt_transform(volume._handle, VoxelFunction(called), None, *words_of(option_words(options)),
                                       ctypes.byref(handle))
    if raised:
        if status == 0:
            library.vkt_free(handle)
        raise raised[0]
    check(status)
    return _result("transform", handle, 4)


def trim() -> int:
    """Gives memory of volumes that are gone back to the system; returns how many bytes. Until then up to as much as a
    volume may take (VKT_MEMORY) is kept for the next results, since touching fresh memory can cost more than an
    operation. The system takes it back by itself when memory is short."""
    return library.vkt_trim()


def python_name(name):
    """--range-sigma is range_sigma, --in is in_."""
    name = name.replace("-", "_")
    return name + "_" if keyword.iskeyword(name) else name


def annotation_text(parameter):
    """The type of a parameter as stubs write it."""
    if parameter["volume"]:
        return "Volume | float" if parameter["positional"] and parameter["name"] in ("a", "b", "c") else "Volume"
    if parameter["volume_file"]:
        return "Volume | np.ndarray | Value" if parameter["positional"] else "Volume | Value"
    if parameter["name"] in ("roi", "roi-world"):
        return "Region"
    if parameter["value"] == "KEY=VALUE":
        return "str | Sequence[str] | Mapping[str, Any]"
    if parameter["flag"]:
        return "bool"
    if parameter["kind"] == "choice":
        base = f"Literal[{', '.join(map(repr, parameter['choices']))}]"
    else:
        base = {"integer": "int", "number": "float", "vector": "float | Sequence[float]", "type": "DType",
                "text": "str" if parameter["choices"] else "Value"}[parameter["kind"]]
    if parameter["most"] == parameter["least"] > 1:
        return {"int": "Sequence[int]", "float": "Sequence[float]"}.get(base, "Sequence[Any]")
    if parameter["most"] != 1:
        return base if base == "Value" else f"{base} | Sequence[{base}]"
    return base


def _default(parameter):
    """The value that the option has if it is not said; None where the library decides, or says it in the help."""
    if parameter["flag"]:
        return False
    if parameter["volume"]:
        return None
    words, kind = parameter["default"], parameter["kind"]
    if not words or words == [""]:
        return None
    if kind in ("integer", "number", "vector"):
        read = int if kind == "integer" else float
        parts = [part for word in words for part in word.split(",")]
        try:
            values = tuple(read(part) for part in parts)
        except ValueError:
            return " ".join(words)
        if any(value != value for value in values):
            return None
        return values[0] if len(set(values)) == 1 and kind == "vector" or len(values) == 1 else values
    return " ".join(words)


class _Argument:
    """One parameter of a function: what it becomes in words."""

    def __init__(self, name, kind, parameter=None, required=False):
        self.name, self.kind, self.parameter = name, kind, parameter
        self.text = "Volume" if parameter is None else annotation_text(parameter)
        self.default = inspect.Parameter.empty
        if kind is not inspect.Parameter.VAR_POSITIONAL and not required:
            self.default = _default(parameter)
            if self.default is None:
                self.text += " | None"

    def words(self, value, inputs, volume_class, operation):
        takes_file = self.parameter is not None and self.parameter["volume_file"]
        if takes_file and isinstance(value, np.ndarray):
            if not self.parameter["positional"]:
                raise Error(f"{operation}: {self.name} is to be a vkt.Volume or a file: an array lies nowhere", 2,
                            "vkt.Volume(array, spacing=..., origin=...)")
            value = volume_class(value)  # a kernel, of which only the values count
        if isinstance(value, volume_class):
            if self.parameter is not None and not self.parameter["volume"] and not takes_file:
                raise Error(f"{operation}: {self.name} takes no volume in memory", 2, "write it, and give its name")
            inputs.append(value)
            if self.parameter is None:
                return []
            return ["-"] if self.parameter["positional"] else ["--" + self.parameter["name"], "-"]
        if self.parameter is None or (self.parameter["volume"] and self.text.startswith("Volume") and
                                      "float" not in self.text):
            if value is None:
                return []
            raise Error(f"{operation}: {self.name} is to be a vkt.Volume, not {type(value).__name__}", 2,
                        "vkt.Volume(array), vkt.read(path)")
        if self.parameter["positional"]:
            return [] if value is None else [value_word(value)]
        return option_words({self.parameter["name"]: value})


def _arguments(operation):
    """The parameters of the function of an operation, in the order of its signature."""
    positional, named = inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY
    names = {0: [], 1: ["volume"], 2: ["volume", "other"]}[operation["inputs"]]
    result = [_Argument(name, positional, required=True) for name in names]
    options = []
    for parameter in operation["parameters"]:
        if not parameter["positional"]:
            options.append(_Argument(python_name(parameter["name"]), named, parameter, parameter["required"]))
        elif parameter["volume"] and parameter["name"] == "in" and parameter["most"] != 1:
            result.append(_Argument("volumes", inspect.Parameter.VAR_POSITIONAL, parameter))
        elif parameter["volume"] and parameter["name"] == "in":
            result.append(_Argument("volume", positional, parameter, True))
        else:
            result.append(_Argument(python_name(parameter["name"]), positional, parameter, parameter["required"]))
    options += [_Argument(python_name(parameter["name"]), named, parameter) for parameter in operation["execution"]]
    return result + options


def _documentation(operation, arguments):
    """The docstring: what it does, its parameters with their units, what it returns, and how far off it can be."""
    def filled(text, indent=""):
        return textwrap.fill(" ".join(text.split()), 100, initial_indent=indent, subsequent_indent=indent)

    parts = [operation["summary"]]
    if operation["alias_of"]:
        parts.append(f"{python_name(operation['alias_of'])}() by another name.")
    parts += [filled(paragraph) for paragraph in operation["description"].split("\n\n") if paragraph]
    lines = ["Parameters", "----------"]
    for argument in arguments:
        star = "*" if argument.kind is inspect.Parameter.VAR_POSITIONAL else ""
        lines.append(f"{star}{argument.name} : {argument.text}")
        help_ = "" if argument.parameter is None else argument.parameter["help"]
        if argument.parameter is not None and argument.parameter["volume"] and argument.name in ("volume", "volumes"):
            help_ = ""
        if help_:
            lines.append(filled(help_, "    "))
        others = [python_name(alias) for alias in (argument.parameter or {}).get("aliases", [])]
        if others and others != [argument.name]:
            lines.append(f"    Also by the name {', '.join(others)}.")
        if argument.text.startswith("Region"):
            lines.append(filled("Also slices or pairs in the order x, y, z, which is not that of the array: "
                                "numpy.s_[0:10, :, 4:], ((0, 10), (0, 20), (4, 9)).", "    "))
    parts.append("\n".join(lines))
    makes = "Volume" if operation["result"] == "volume" else "dict"
    told = "" if makes == "Volume" else f"\n    What `vkt {operation['name']} --json` prints; a list of these of several."
    parts.append(f"Returns\n-------\n{makes}{told}")
    if operation["accuracy"]:
        parts.append("Accuracy\n--------\n" + filled(operation["accuracy"]))
    if operation["examples"]:
        lines = [f"    {example['line']}" for example in operation["examples"]]
        parts.append("Examples of the command\n-----------------------\n" + "\n".join(lines))
    return "\n\n".join(parts) + "\n"


def function_of(name, module):
    """The function of a registered operation, with a signature of its own."""
    operation = registered(name)
    arguments = _arguments(operation)
    by_name = {argument.name: argument for argument in arguments}
    types = {"Volume": _volume_class(), **globals()}
    signature = inspect.Signature(
        [inspect.Parameter(argument.name, argument.kind, default=argument.default,
                           annotation=_evaluated(argument.text, types)) for argument in arguments],
        return_annotation=types["Volume"] if operation["result"] == "volume" else _Report)
    head, volume_class = name.split(), types["Volume"]
    in_order = [argument for argument in arguments if argument.kind is not inspect.Parameter.KEYWORD_ONLY]
    several = in_order[-1] if in_order and in_order[-1].kind is inspect.Parameter.VAR_POSITIONAL else None
    spelled = {python_name(alias): argument.name for argument in arguments if argument.parameter
               for alias in argument.parameter["aliases"] if python_name(alias) not in by_name}
    required = [argument.name for argument in arguments
                if argument.default is inspect.Parameter.empty and argument is not several]

    def function(*given, **options):
        # What signature.bind() does, in a tenth of the time; it finds the words for what is wrong.
        if not spelled.keys().isdisjoint(options):
            renamed = {spelled.get(key, key): value for key, value in options.items()}
            if len(renamed) < len(options):
                raise TypeError(f"{name}: an argument is given by two of its names")
            options = renamed
        named = {argument.name for argument, _ in zip(in_order, given)}
        right = (several or len(given) <= len(in_order)) and options.keys() <= by_name.keys() - named and all(
            name in named or name in options for name in required) and not (several and several.name in options)
        if not right:
            signature.bind(*given, **options)
        words, inputs = list(head), []
        for i, value in enumerate(given):
            words += (several or in_order[i]).words(value, inputs, volume_class, name)
        for argument in in_order if len(named) < len(in_order) and options else ():
            if argument.name in options:
                words += argument.words(options[argument.name], inputs, volume_class, name)
        for key, value in options.items():
            if by_name[key].kind is inspect.Parameter.KEYWORD_ONLY:
                words += by_name[key].words(value, inputs, volume_class, name)
        return applied(name, words, inputs, 4, operation)

    function.__name__ = python_name(head[-1])
    function.__qualname__ = function.__name__
    function.__module__ = module
    function.__signature__ = signature
    function.__annotations__ = {**{a.name: signature.parameters[a.name].annotation for a in arguments},
                                "return": signature.return_annotation}
    function.__doc__ = _documentation(operation, arguments)
    function.texts = {argument.name: argument.text for argument in arguments}  # for stubs
    function.spelled = {alias: name for alias, name in spelled.items() if by_name[name].parameter["positional"]}
    return function


_Report = typing.Dict[str, Any]
_evaluations = {}


def _evaluated(text, types):
    if text not in _evaluations:
        _evaluations[text] = eval(text, types)  # texts of annotation_text(), of the registry's own words
    return _evaluations[text]


def functions(prefix, module):
    """The functions of the operations whose names begin so, by their names in Python; but for transform(), which takes
    functions, too."""
    made = {}
    for name in operations():
        words = name.split()
        if words[:-1] == prefix and name != "transform":
            made[python_name(words[-1])] = function_of(name, module)
    return made
