"""Chains of && in bats files that cannot fail: chains.py FILE… prints them. "set -e" ignores a in "a && b", so the line passes
when a fails, unless it is the last of a test or function. Conditions, subshells, and chains that go on with || or end in
break, continue, return or skip are meant so. SPDX-License-Identifier: MIT"""
import re
import sys


def statements(text):
    """Lines of shell code without comments, here documents and quoted text, each with its number and those it goes on with."""
    code, number, start, quote, here = "", 1, 1, None, None
    i = 0
    while i < len(text):
        c = text[i]
        if c == "\n":
            number += 1
        if quote:
            if c == "\\" and quote == '"':
                number += text[i + 1] == "\n"
                i += 1
            elif c == quote:
                quote = None
        elif c == "\\":
            number += text[i + 1] == "\n"
            i += 1
        elif c in "'\"":
            quote = c
            code += '"'
        elif c == "#" and (not code or code[-1].isspace() or code[-1] == ";"):
            i = text.index("\n", i) - 1
        elif c == "\n":
            if re.search(r"(&&|\|\||\|)\s*$", code):
                code += " "
            else:
                yield start, code
                code, start = "", number
            if here:
                end = re.compile(rf"^\t*{re.escape(here)}$", re.M).search(text, i)
                number += text.count("\n", i + 1, end.end())
                start, here, i = number, None, end.end() - 1
        else:
            if word := re.compile(r"(?<!<)<<-?\s*[\"']?(\w+)").match(text, i):
                here = word[1]
                i = word.end() - 1 + (text[word.end()] in "\"'")
            else:
                code += c
        i += 1


found = False
for name in sys.argv[1:]:
    with open(name, encoding="utf-8") as file:
        lines = list(statements(file.read() + "\n"))
    for (number, code), (_, after) in zip(lines, lines[1:] + [(0, "")]):
        if re.match(r"\s*[\w-]+\(\) \{.*\}\s*$", code):  # a function in a line: what comes last is its result
            code = re.sub(r";[^;]*;\s*\}\s*$", "", re.sub(r"^.*?\{", ";", code))
        code = re.sub(r"\[\[.*?\]\]", "", code)
        while (less := re.sub(r"\([^()]*\)", "", code)) != code:
            code = less
        for part in code.split(";"):
            part = re.sub(r"^(\s*(then|do|else|\{|[^()\s]+\)))*", "", part)
            if "&&" not in part or "||" in part.rsplit("&&")[-1] or re.match(r"\s*(if|elif|while|until)\b", part):
                continue
            if re.match(r"\s*(break|continue|return|skip)\b", part.rsplit("&&")[-1]) or after.startswith("}"):
                continue
            print(f"{name}:{number}: {part.strip()}")
            found = True
sys.exit(found)
