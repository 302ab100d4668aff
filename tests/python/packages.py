"""Looks at the files of packaging/ that nothing here builds: what they say of the version, and the files and commands that they name."""

import re
import tomllib
from pathlib import Path

import yaml
from lupa import LuaRuntime

CARGO = tomllib.loads(Path("Cargo.toml").read_text())
VERSION = CARGO["package"]["version"]
PACKAGING = Path("packaging")


def conda():
    recipe = yaml.safe_load((PACKAGING / "conda/recipe.yaml").read_text())
    assert recipe["context"]["version"] == VERSION, f"the recipe for conda is for {recipe['context']['version']}, not {VERSION}"
    assert (PACKAGING / "conda" / recipe["source"]["path"] / "Cargo.toml").is_file(), "the recipe's source is not the project"
    assert recipe["about"]["license"] == CARGO["package"]["license"]


def wheel():
    project = tomllib.loads(Path("pyproject.toml").read_text())["project"]
    assert project["dynamic"] == ["version"] and "version" not in project, "the version of the wheel is not that of Cargo.toml"
    for key in ("name", "description", "license"):
        assert project[key] == CARGO["package"][key], f"pyproject.toml has another {key} than Cargo.toml"
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


def module():
    """Runs the module file with what Lmod gives it, and returns what it prepends."""
    lua, paths = LuaRuntime(), {}
    given = lua.globals()
    given.myModuleVersion = lambda: VERSION
    given.pathJoin = lambda *parts: "/".join(parts)
    given.whatis = given.help = lambda text: None
    given.prepend_path = lambda name, value: paths.__setitem__(name, value)
    lua.execute((PACKAGING / "modulefile.lua").read_text())
    root = f"/opt/apps/gdt-batch/{VERSION}"
    assert paths == {"PATH": f"{root}/bin", "MANPATH": f"{root}/share/man", "XDG_DATA_DIRS": f"{root}/share"}, paths


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


for check in (conda, wheel, deb, module, images):
    check()
