"""Prints the licences of all crates that are in the program for a target, with their texts, as their owners ask of who passes them on."""

import json
import re
import subprocess
import sys
from pathlib import Path

IS_LICENCE = re.compile(r"^(licen[cs]e|copying|notice|unlicense|copyright)([-_. ].*)?$", re.IGNORECASE)
HEAD = """gdt-batch itself may be used under MIT or Apache-2.0. It contains the crates below, each under its own licence.
The page of `gdt-batch view` has the licences of its parts inside.
"""


def metadata(target):
    command = ["cargo", "metadata", "--format-version", "1", "--locked", "--filter-platform", target]
    return json.loads(subprocess.run(command, check=True, capture_output=True).stdout)


def crates_of(data):
    """Returns the packages that are compiled into the program, without its own: no build scripts, no tests."""
    nodes = {node["id"]: node for node in data["resolve"]["nodes"]}
    root = data["resolve"]["root"]
    found, waiting = set(), [root]
    while waiting:
        node = nodes[waiting.pop()]
        if node["id"] not in found:
            found.add(node["id"])
            waiting += [dep["pkg"] for dep in node["deps"] if any(kind["kind"] is None for kind in dep["dep_kinds"])]
    packages = [package for package in data["packages"] if package["id"] in found - set(data["workspace_members"])]
    return sorted(packages, key=lambda package: (package["name"], package["version"]))


def texts_of(package):
    """Returns the licences that lie in the folder of a package, also those of sources that it brings along."""
    folder = Path(package["manifest_path"]).parent
    files = sorted(path for path in folder.rglob("*") if IS_LICENCE.match(path.name) and path.is_file())
    return [path.read_text(encoding="utf-8", errors="replace").strip() for path in files]


def main(target):
    users = {}
    packages = crates_of(metadata(target))
    print(HEAD)
    for package in packages:
        texts = texts_of(package)
        authors = "" if texts else f" (its package holds no text of it; by {', '.join(package['authors']) or 'its developers'})"
        print(f"{package['name']} {package['version']}: {package['license']}{authors}")
        for text in texts:
            users.setdefault(text, []).append(package["name"])
    for text, names in users.items():
        print(f"\n{'=' * 80}\n{', '.join(dict.fromkeys(names))}\n{'=' * 80}\n\n{text}")


if __name__ == "__main__":
    main(sys.argv[1])
