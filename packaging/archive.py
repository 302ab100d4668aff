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

# 1980, before which a .zip knows no times.
FIRST_OF_ZIP = 315532800
EPOCH = int(os.environ.get("SOURCE_DATE_EPOCH", FIRST_OF_ZIP))


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
            entry = zipfile.ZipInfo(path.relative_to(folder.parent).as_posix(), time.gmtime(max(EPOCH, FIRST_OF_ZIP))[:6])
            entry.external_attr = (0o100000 | mode_of(path)) << 16
            archive.writestr(entry, path.read_bytes(), zipfile.ZIP_DEFLATED)
    return packed.getvalue()


def replace(file, data):
    """Writes a file whole or not at all."""
    new = file.with_name(file.name + ".new")
    new.write_bytes(data)
    new.replace(file)


def main(folder):
    if not files_of(folder):
        sys.exit(f"archive.py: there is no file in {folder}: run packaging/build first")
    is_windows = any((folder / "bin").glob("*.exe"))
    archive = folder.with_name(folder.name + (".zip" if is_windows else ".tar.gz"))
    data = zipped(folder) if is_windows else tar_gz(folder)
    checksum = hashlib.sha256(data).hexdigest()
    beside = archive.with_name(archive.name + ".sha256")
    # An archive never stands beside the checksum of another one.
    beside.unlink(missing_ok=True)
    replace(archive, data)
    # In the form of `sha256sum`, which also checks it.
    replace(beside, f"{checksum}  {archive.name}\n".encode())
    print(f"{archive}: {len(data) / 1e6:.1f} MB, SHA-256 {checksum}")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
