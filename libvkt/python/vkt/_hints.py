"""Hints of the library, which speak of options as the command line has them, in words of Python."""
# SPDX-License-Identifier: MIT
import functools
import re
import shlex

from . import _operations

_FLAGS = {"force", "force-uniform", "trust-paths", "no-checksum", "no-history", "personal"}  # of reading and writing
_OPTION = re.compile(r"(\W*?)--([a-z][a-z0-9-]*)(?:=([^\s;]*?))?([;,.:?)'\"]*)")
_WORD = r"(?:'[^']*'|\\.|[^\s'\\])+"
_READ = re.compile(rf"vkt read ({_WORD}) --([a-z-]+)(?: ({_WORD}))? \| \.\.\.")  # as files and names are quoted for a shell
_ENDED = re.compile(r"(.*?)([;,.?)'\"]*)")


def in_python(hint):
    """--force is force=True, --method nearest is method="nearest", --dtype is dtype=, vkt resample --like FIRST is
    vkt.resample(like=FIRST), vkt read FILE --variable NAME | ... is vkt.read("FILE", variable="NAME")."""
    if found := _READ.search(hint):
        file, name, value = found.groups()
        option = f"{_name(name)}=" + ("True" if value is None else _quoted(value))
        return in_python(hint[:found.start()]) + f"vkt.read({_quoted(file)}, {option})" + in_python(hint[found.end():])
    words, said = hint.replace("vkt_series_open()", "vkt.read_series()").split(" "), []
    while words:
        call = _call(words)
        if call:
            said.append(call)
        elif _OPTION.fullmatch(words[0]):
            said.append("".join(_option(words, _known()[0])))
        else:  # also in the middle of a word, "--first/--last"
            said.append(re.sub(r"--([a-z][a-z0-9-]*)", lambda found: _name(found[1]) + "=", words.pop(0)))
    return " ".join(said)


def _quoted(word):
    """What a shell makes of a word, as Python writes it."""
    text = "".join(shlex.split(word)).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{text}"'


def _name(option):
    return _operations.python_name(option)


@functools.lru_cache(maxsize=None)
def _known():
    """What is a flag of every operation that has it, and what options choose from, but for words of sentences."""
    parameters = [parameter for name in _operations.operations()
                  for parameter in _operations.registered(name)["parameters"]]
    return (_FLAGS | _flags(parameters) - {parameter["name"] for parameter in parameters if not parameter["flag"]},
            {choice for parameter in parameters for choice in parameter["choices"]} - {"and", "or", "not"} | {"minmax"})


def _flags(parameters):
    return {parameter["name"] for parameter in parameters if parameter["flag"]}


def _is_value(word):
    return bool(re.match(r"[-:.]?\d|[A-Z][A-Z0-9_]*([:,][A-Z0-9_]+)*$", word)) or word in _known()[1] or (
        len(word) > 2 and re.search(r"\w[=:]\w", word) is not None)


def _written(word):
    """A value as Python has it; what stands for one, FILE, as it is."""
    parts = word.split(",")
    if all(re.fullmatch(r"[A-Z][A-Z0-9_]*|-?[\d.]+", part) for part in parts):
        return parts[0] if len(parts) == 1 else f"({', '.join(parts)})"
    return f'"{word}"'


def _option(words, flags):
    """What comes before the first word, it and its values as one argument, and what comes after; taken off."""
    before, name, value, after = _OPTION.fullmatch(words.pop(0)).groups()
    values = [] if value is None else [value]
    if name in flags:
        return before, f"{_name(name)}=True", after
    while words and not after and value is None:
        word, end = _ENDED.fullmatch(words[0]).groups()
        named = name == "variable" and not values  # names are any words
        if not (named or _is_value(word)) or (values and not re.fullmatch(r"[A-Z]|\d+", word)):
            break
        values.append(word)
        after = end
        words.pop(0)
    return before, f"{_name(name)}={_written(','.join(values)) if values else ''}", after


def _call(words):
    """A command as a call, if the words begin with one; taken off."""
    begin = re.fullmatch(r"(\W*)vkt", words[0])
    for n in (2, 1) if begin else ():
        last = _ENDED.fullmatch(words[n]).groups() if len(words) > n else None
        if last is None or " ".join([*words[1:n], last[0]]) not in _operations.operations():
            continue
        parts, after = [*words[1:n], last[0]], last[1]
        flags = _FLAGS | _flags(_operations.registered(" ".join(parts))["parameters"])
        del words[:n + 1]
        arguments = []
        while words and not after:
            if _OPTION.fullmatch(words[0]):
                _, argument, after = _option(words, flags)
                arguments.append(argument + "..." if argument.endswith("=") else argument)
                continue
            word, end = _ENDED.fullmatch(words[0]).groups()
            if not re.fullmatch(r"[A-Z]{2,}", word):
                break
            arguments.append(word)
            after = end
            words.pop(0)
        return f"{begin[1]}vkt.{'.'.join(map(_name, parts))}({', '.join(arguments)}){after}"
    return None
