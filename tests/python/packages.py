"""Looks at the files of packaging/ that nothing here builds: what they say of the version, and the files and commands that they name.
Tries the small scripts of packaging/ that need no build.
"""

import hashlib
import os
import re
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

import yaml
from lupa import LuaRuntime

CARGO = tomllib.loads(Path("Cargo.toml").read_text())
# What all crates have in common is in the workspace.
PACKAGE = {**CARGO["package"], **CARGO["workspace"]["package"]}
VERSION = PACKAGE["version"]
PACKAGING = Path("packaging")


def conda():
    recipe = yaml.safe_load((PACKAGING / "conda/recipe.yaml").read_text())
    assert recipe["context"]["version"] == VERSION, f"the recipe for conda is for {recipe['context']['version']}, not {VERSION}"
    assert (PACKAGING / "conda" / recipe["source"]["path"] / "Cargo.toml").is_file(), "the recipe's source is not the project"
    assert recipe["about"]["license"] == PACKAGE["license"]


def wheel():
    project = tomllib.loads(Path("pyproject.toml").read_text())["project"]
    assert project["dynamic"] == ["version"] and "version" not in project, "the version of the wheel is not that of Cargo.toml"
    for key in ("name", "description", "license"):
        assert project[key] == PACKAGE[key], f"pyproject.toml has another {key} than Cargo.toml"
    assert all(Path(file).is_file() for file in project["license-files"] + [project["readme"]])


def deb():
    """Every file is in the project, or one that packaging/texts and packaging/build make."""
    made = re.findall(r"^write (\S+)", (PACKAGING / "texts").read_text(), re.MULTILINE)
    for source, *_ in CARGO["package"]["metadata"]["deb"]["assets"]:
        of_texts = source.removeprefix("target/packages/deb/")
        known = Path(source).is_file() or source == "target/release/gdt-batch" or of_texts in made or of_texts == "doc/gdt-batch/*"
        assert known, f"nothing makes {source}"
    assert f"libc6 (>= {glibc()})" in CARGO["package"]["metadata"]["deb"]["depends"]


def glibc():
    return re.search(r"^GLIBC=(\S+)$", (PACKAGING / "common").read_text(), re.MULTILINE)[1]


def with_module(paths):
    """Runs the module file with what Lmod gives it, and returns the environment that it makes of `paths`."""
    lua, paths = LuaRuntime(), dict(paths)
    given = lua.globals()
    given.myModuleVersion = lambda: VERSION
    given.pathJoin = lambda *parts: "/".join(parts)
    given.whatis = given.help = lambda text: None
    given.os.getenv = paths.get
    given.prepend_path = lambda name, value: paths.update({name: ":".join(filter(None, [value, paths.get(name)]))})
    given.append_path = lambda name, value: paths.update({name: ":".join(filter(None, [paths.get(name), value]))})
    lua.execute((PACKAGING / "modulefile.lua").read_text())
    return paths


def module():
    """What other programs find without the module, they find with it."""
    root = f"/opt/apps/gdt-batch/{VERSION}"
    bare = with_module({"PATH": "/bin"})
    assert bare == {"PATH": f"{root}/bin:/bin", "XDG_DATA_DIRS": f"{root}/share:/usr/local/share:/usr/share"}, bare
    full = with_module({"PATH": "/bin", "MANPATH": "/a:", "XDG_DATA_DIRS": "/b"})
    expected = {"PATH": f"{root}/bin:/bin", "MANPATH": f"{root}/share/man:/a:", "XDG_DATA_DIRS": f"{root}/share:/b"}
    assert full == expected, full


def images():
    """Both copy files that packaging/build puts into the folder of a package."""
    build, texts = (PACKAGING / "build").read_text(), (PACKAGING / "texts").read_text()
    apptainer = (PACKAGING / "apptainer.def").read_text()
    section = re.search(r"^%files\n(.*?)\n\n", apptainer, re.MULTILINE | re.DOTALL)[1]
    copied = [line.split()[0] for line in section.splitlines()]
    for line in re.findall(r"^COPY (.*) \S+$", (PACKAGING / "Containerfile").read_text(), re.MULTILINE):
        copied += line.split()
    for file in copied:
        assert Path(file).name in build + texts, f"packaging/build does not make {file}"
    sections = re.findall(r"^%(\w+)", apptainer, re.MULTILINE)
    assert sections == ["files", "test", "runscript", "labels", "help"], sections


def links():
    """No page of an archive leads to a file that packaging/build does not put into it."""
    packed = {path for folder in ("docs", "configs") for path in Path(folder).rglob("*")}
    packed |= {Path(name) for name in ("docs", "configs", "LICENSE-MIT", "LICENSE-APACHE")} | set(Path().glob("*.md"))
    names = re.search(r"^cp packaging/\{(\S+)\} ", (PACKAGING / "build").read_text(), re.MULTILINE)[1]
    packed |= {PACKAGING / name for name in names.split(",")}
    for page in sorted(path for path in packed if path.suffix == ".md"):
        for link in re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", page.read_text()):
            target = Path(os.path.normpath(page.parent / link))
            assert ":" in link or target in packed, f"{page} leads to {link}, which no archive has"


def refused(words, *command, **environment):
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **environment})
    assert done.returncode == 1 and words in done.stderr, (command, done)


def scripts():
    """Scripts say what is wrong, before they fetch or build anything."""
    with tempfile.TemporaryDirectory() as folder:
        refused("there are no packages for nosuch-target", "packaging/build", "nosuch-target")
        refused("printed nothing", "packaging/texts", "/bin/true", folder)
        refused("has no symbol of glibc", "packaging/glibc", __file__, "2.28")
        refused("there is no file in", sys.executable, "packaging/archive.py", f"{folder}/none")
        program = Path(folder, "package/bin/gdt-batch.exe")
        program.parent.mkdir(parents=True)
        program.write_bytes(b"program")
        # A .zip begins in 1980.
        command = [sys.executable, "packaging/archive.py", str(program.parents[1])]
        subprocess.run(command, check=True, capture_output=True, env={**os.environ, "SOURCE_DATE_EPOCH": "0"})
        data = Path(folder, "package.zip").read_bytes()
        checksum = f"{hashlib.sha256(data).hexdigest()}  package.zip\n"
        assert Path(folder, "package.zip.sha256").read_bytes() == checksum.encode()


for check in (conda, wheel, deb, module, images, links, scripts):
    check()
