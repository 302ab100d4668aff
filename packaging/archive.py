"""Packs a folder: as .zip if there is a program for Windows in it, otherwise as .tar.gz; and writes the SHA-256 of the archive beside it.

The bytes follow from the files and SOURCE_DATE_EPOCH: names are sorted, and nothing says who packed them.
"""

import gzip
import hashlib
import io
import os
import sys
import tarfile
import time
import zipfile
from pathlib import Path

EPOCH = int(os.environ.get("SOURCE_DATE_EPOCH", "315532800"))


def files_of(folder):
    return sorted(path for path in folder.rglob("*") if path.is_file())


def mode_of(path):
    """Returns the rights of a file: programs lie in bin/."""
    return 0o755 if path.parent.name == "bin" else 0o644


def tar_gz(folder):
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as archive:
        for path in files_of(folder):
            entry = tarfile.TarInfo(path.relative_to(folder.parent).as_posix())
            entry.size, entry.mode, entry.mtime = path.stat().st_size, mode_of(path), EPOCH
            with path.open("rb") as file:
                archive.addfile(entry, file)
    return gzip.compress(packed.getvalue(), mtime=0)


def zipped(folder):
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in files_of(folder):
            entry = zipfile.ZipInfo(path.relative_to(folder.parent).as_posix(), time.gmtime(EPOCH)[:6])
            entry.external_attr = (0o100000 | mode_of(path)) << 16
            archive.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def main(folder):
    is_windows = any((folder / "bin").glob("*.exe"))
    archive = folder.with_name(folder.name + (".zip" if is_windows else ".tar.gz"))
    data = zipped(folder) if is_windows else tar_gz(folder)
    archive.write_bytes(data)
    checksum = hashlib.sha256(data).hexdigest()
    # In the form of `sha256sum`, which also checks it.
    archive.with_name(archive.name + ".sha256").write_text(f"{checksum}  {archive.name}\n", newline="\n")
    print(f"{archive}: {len(data) / 1e6:.1f} MB, SHA-256 {checksum}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
