"""FMU archives are untrusted: what could do harm is refused by name, and nothing is written outside of a folder."""

from __future__ import annotations

import errno
import os
import stat
import struct
import zipfile
from pathlib import Path

import pytest

from cosim.errors import ArchiveError, FmuError, MissingFile
from cosim.fmu import archive
from cosim.fmu.versions import FMI2, FMI3

XML = '<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0"/>'


@pytest.fixture
def packed(tmp_path):
    """Write an archive with these members beside a description."""

    def pack(members: dict[str | zipfile.ZipInfo, str | bytes], description: str | bytes = XML) -> Path:
        path = tmp_path / "some.fmu"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
            file.writestr("modelDescription.xml", description)
            for name, content in members.items():
                file.writestr(name, content)
        return path

    return pack


def test_members_come_out_as_they_went_in(packed):
    folder = archive.unpack(packed({"resources/table.txt": "1 2 3", "binaries/linux64/a.so": b"\x7fELF"}))
    assert (folder / "resources" / "table.txt").read_text() == "1 2 3"
    assert archive.binaries(folder) == ["linux64"]


def test_a_file_is_unpacked_once_and_again_when_it_changes(packed):
    first = archive.unpack(packed({"a": "1"}))
    assert archive.unpack(packed({"a": "1"}).with_name("some.fmu")) != first  # written anew
    path = packed({"a": "2"})
    assert archive.unpack(path) == archive.unpack(path)
    assert (archive.unpack(path) / "a").read_text() == "2"


@pytest.mark.parametrize("name", ["../evil", "resources/../../evil", "/evil", "a/../../../evil"])
def test_no_member_leaves_its_folder(packed, tmp_path, name):
    with pytest.raises(ArchiveError, match="would be written outside of its folder"):
        archive.unpack(packed({name: "x"}))
    assert not list(tmp_path.parent.glob("**/evil"))


@pytest.mark.parametrize("name", ["..\\evil", "C:evil", "resources\\a"])
def test_names_that_some_systems_read_as_paths_are_refused(packed, name):
    with pytest.raises(ArchiveError, match="name that not every system can have"):
        archive.unpack(packed({name: "x"}))


def test_links_are_refused(packed):
    link = zipfile.ZipInfo("resources/link")
    link.external_attr = (stat.S_IFLNK | 0o777) << 16
    with pytest.raises(ArchiveError, match="`resources/link` is a link"):
        archive.unpack(packed({link: "/etc/passwd"}))


def test_an_archive_that_explodes_is_refused(packed, monkeypatch):
    monkeypatch.setattr(archive, "SUSPICIOUS_BYTES", 1 << 20)
    with pytest.raises(ArchiveError, match=r"\d+ bytes unpack to"):
        archive.unpack(packed({"zeros": bytes(16 << 20)}))


def test_too_many_members_are_refused(packed, monkeypatch):
    monkeypatch.setattr(archive, "MOST_MEMBERS", 5)
    with pytest.raises(ArchiveError, match="7 members"):
        archive.unpack(packed({f"m{k}": "" for k in range(6)}))


def test_a_member_that_is_larger_than_it_says_is_not_written_on(packed):
    """The sizes in the directory and in the local header say 10 bytes; the data hold a million."""
    path = packed({"resources/big": bytes(1_000_000)})
    data = path.read_bytes()
    lied = data.replace(struct.pack("<I", 1_000_000), struct.pack("<I", 10))
    path.write_bytes(lied)
    with pytest.raises(ArchiveError, match="no sound FMU archive"):
        archive.unpack(path)


@pytest.mark.parametrize("cut", [10, 100, 400])
def test_a_truncated_archive_is_refused(packed, cut):
    path = packed({"resources/a": bytes(range(256)) * 8})
    path.write_bytes(path.read_bytes()[:-cut])
    with pytest.raises(ArchiveError, match="no sound FMU archive"):
        archive.unpack(path)


def test_a_full_disk_is_not_the_archive_s_fault(packed, monkeypatch):
    def full(archive, member, folder):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(archive, "_extract_member", full)
    with pytest.raises(ArchiveError, match=r"cannot unpack `.*some\.fmu` into .*: No space left on device") as caught:
        archive.unpack(packed({"a": "1"}))
    assert "free some space" in caught.value.fix and "export" not in str(caught.value)


def test_damaged_data_are_refused(packed):
    path = packed({"resources/a": bytes(range(256)) * 8})
    data = bytearray(path.read_bytes())
    at = data.index(b"resources/a") + 30
    data[at] ^= 0xFF
    path.write_bytes(data)
    with pytest.raises(ArchiveError, match="no sound FMU archive"):
        archive.unpack(path)


BOMB = """<!DOCTYPE f [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;">]>
<fmiModelDescription fmiVersion="2.0" modelName="&b;"/>"""
FILE = """<!DOCTYPE f [<!ENTITY secret SYSTEM "file:///etc/passwd">]>
<fmiModelDescription fmiVersion="2.0" description="&secret;"/>"""


@pytest.mark.parametrize(
    "text", [BOMB, FILE, BOMB.encode("utf-16"), '<!DOCTYPE f SYSTEM "http://example.org/x.dtd"><f/>']
)
def test_entities_are_refused_whatever_the_encoding(packed, text):
    with pytest.raises(ArchiveError, match=r"document type|external entity"):
        archive.unpack(packed({}, text))


def test_a_description_that_is_no_xml_is_refused(packed):
    with pytest.raises(ArchiveError, match="not well-formed"):
        archive.unpack(packed({}, "<fmiModelDescription"))


def test_an_archive_without_a_description_is_no_fmu(tmp_path):
    with zipfile.ZipFile(tmp_path / "a.fmu", "w") as file:
        file.writestr("readme", "x")
    with pytest.raises(ArchiveError, match=r"has no modelDescription\.xml"):
        archive.unpack(tmp_path / "a.fmu")


def test_a_file_that_is_missing_is_named(tmp_path):
    with pytest.raises(MissingFile, match=r"nothing\.fmu"):
        archive.unpack(tmp_path / "nothing.fmu")


def test_a_missing_binary_says_which_there_are(packed):
    folder = archive.unpack(packed({"binaries/win64/a.dll": "x", "binaries/darwin64/a.dylib": "x", "sources/a.c": ""}))
    with pytest.raises(FmuError, match="it has darwin64, win64, and C sources"):
        archive.binary(folder, "a", FMI2, "some.fmu")


def test_a_binary_is_found_under_either_version_s_name(packed):
    old, new = archive.platforms(FMI2)
    assert archive.platforms(FMI3) == [new, old]
    folder = archive.unpack(packed({f"binaries/{new}/a{archive.suffix()}": "x"}))
    assert archive.binary(folder, "a", FMI2, "some.fmu").parent.name == new
