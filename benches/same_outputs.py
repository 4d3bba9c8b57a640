"""Compares two folders of outputs file by file; every difference is named. Exit code 1 if any is left.

Text may name things differently (keys of reports, headings) as long as every figure in it is the same and in the same order:
such a file counts as renamed, and its words are listed. Figures that are times are left out by their key.

    python3 benches/same_outputs.py OUT_BASE OUT_HEAD
"""

import json
import re
import sys
from pathlib import Path

# Keys and lines of what the machine took, which no two runs share.
TIME = re.compile(r"^planning_|^wall_|cpu|peak_rss|_(ms|us)(_|$)|per_second")
TIME_LINE = re.compile(r"processor time|planning|wall clock|\bms\b|resident|took|computed in")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
TEXT = {".json", ".md", ".txt", ".toml", ".yaml", ""}
# Files that are called otherwise now: part of the former name, of the present one.
RENAMED = [("film.png", "progress.png"), ("survey.", "scan_flight."), ("survey_", "scan_flight_")]


def leaves(value, key=""):
    """Key and value of every leaf of a JSON document, in order."""
    if isinstance(value, dict):
        for name, child in value.items():
            yield from leaves(child, f"{key}.{name}" if key else name)
    elif isinstance(value, list):
        for child in value:
            yield from leaves(child, f"{key}[]")
    else:
        yield key, value


def json_difference(base, head, timed):
    """None if equal but for names and times; otherwise what differs. The renamed keys."""
    base, head = list(leaves(base)), list(leaves(head))
    renamed = []
    if len(base) != len(head):
        gone = sorted({k for k, _ in base} - {k for k, _ in head})
        new = sorted({k for k, _ in head} - {k for k, _ in base})
        return f"{len(base)} values became {len(head)}: gone {gone}, new {new}", renamed
    for (base_key, base_value), (head_key, head_value) in zip(base, head):
        if base_key != head_key:
            renamed.append(f"{base_key} -> {head_key}")
        if base_value != head_value and base_key not in timed and head_key not in timed:
            return f"{base_key}: {base_value} became {head_value}", renamed
    return None, renamed


def text_difference(base, head):
    """Line by line: figures must agree; lines about times are passed over."""
    base, head = base.splitlines(), head.splitlines()
    if len(base) != len(head):
        return f"{len(base)} lines became {len(head)}", []
    renamed = []
    for number, (one, two) in enumerate(zip(base, head), 1):
        if one == two:
            continue
        if TIME_LINE.search(one) and TIME_LINE.search(two):
            continue
        if NUMBER.findall(one) != NUMBER.findall(two):
            return f"line {number}: {one!r} became {two!r}", renamed
        renamed.append(f"line {number}")
    return None, renamed


def is_time(key):
    return bool(TIME.search(key.split(".")[-1].rstrip("[]")))


def compare(base, head):
    """What differs between two files, and what was only renamed."""
    one, two = base.read_bytes(), head.read_bytes()
    if one == two:
        return None, []
    if base.suffix == ".json":
        documents = json.loads(one), json.loads(two)
        timed = {key for document in documents for key, _ in leaves(document) if is_time(key)}
        return json_difference(*documents, timed)
    if base.suffix in TEXT:
        return text_difference(one.decode(), two.decode())
    return f"{len(one)} bytes became {len(two)}, or others", []


def listing(root):
    """Files below a folder by their present names."""
    files = {}
    for path in (p for p in root.rglob("*") if p.is_file() and p.name != "log"):
        name = path.name
        for former, present in RENAMED:
            name = name.replace(former, present)
        files[path.relative_to(root).with_name(name)] = path
    return files


def main():
    base, head = (listing(Path(root)) for root in sys.argv[1:3])
    counts = {"same": 0, "renamed": 0, "different": 0}
    for name in sorted(base.keys() ^ head.keys()):
        counts["different"] += 1
        print(f"{name}: only in {'the base' if name in base else 'the head'}")
    for name in sorted(base.keys() & head.keys()):
        different, renamed = compare(base[name], head[name])
        if base[name].name != head[name].name:
            renamed.append(f"formerly {base[name].name}")
        kind = "different" if different else "renamed" if renamed else "same"
        counts[kind] += 1
        if different:
            print(f"{name}: {different}")
        for words in renamed:
            print(f"{name}: renamed: {words}")
    print(", ".join(f"{count} {kind}" for kind, count in counts.items()))
    return counts["different"] > 0 or not any(counts.values())


if __name__ == "__main__":
    sys.exit(main())
