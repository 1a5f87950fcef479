"""A zip file of somebody else: bounded, and nothing in it leads elsewhere."""

import stat
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from zipfile import ZIP_BZIP2, ZIP_DEFLATED, ZIP_STORED, ZipFile, ZipInfo

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoros.base.errors import InputError
from evoros.files import zipped
from evoros.files.zipped import add_folder, add_member, open_zip, read_member, seal_zip

LINK = (stat.S_IFLNK | 0o777) << 16
PIPE = (stat.S_IFIFO | 0o644) << 16


def entry(name: str, attributes: int = 0, packing: int = ZIP_STORED) -> ZipInfo:
    member = ZipInfo("x")
    member.filename = name
    member.external_attr, member.compress_type = attributes, packing
    return member


def write(path: Path, *members: tuple[ZipInfo, bytes]) -> Path:
    """Write members as they are, with the right digest."""
    with path.open("w+b") as file:
        with ZipFile(file, "w") as archive:
            for member, content in members:
                archive.writestr(member, content)
        seal_zip(file)
    return path


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as error, open_zip(path):
        pass
    assert str(error.value).startswith(f"{path}: ")
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize(
    "name",
    ["../x", "a/../../x", "/x", "a//x", "./x", "a/.", "..", "C:x", "a\\x", "a\nx", "\x1b[2Jx"],
)
def test_no_name_leads_elsewhere(name: str, tmp_path: Path) -> None:
    file = write(tmp_path / "a.zip", (entry("first"), b""), (entry(name), b"x"))
    assert "must contain only normalized relative paths" in refusal(file)


@pytest.mark.filterwarnings("ignore:Duplicate name")
@pytest.mark.parametrize(
    ("member", "content", "said"),
    [
        (entry("x", LINK), b"/etc/passwd", "'x' is a link or a device"),
        (entry("x", PIPE), b"", "'x' is a link or a device"),
        (entry("x/", LINK), b"", "'x' is a link or a device"),
        (entry("x/"), b"content", "'x' has data"),
        (entry("first"), b"", "each file only once, but has 'first' twice"),
        (entry("first/x"), b"", "'first' is both"),
        (entry("x", packing=ZIP_BZIP2), b"x", "'x' is neither"),
        (entry("x", packing=ZIP_DEFLATED), bytes(2**22), "compression ratios up to 100"),
    ],
)
def test_what_is_no_plain_file_is_refused(
    member: ZipInfo, content: bytes, said: str, tmp_path: Path
) -> None:
    assert said in refusal(write(tmp_path / "a.zip", (entry("first"), b""), (member, content)))


def test_an_encrypted_file_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "a.zip"
    with file.open("w+b") as stream:
        with ZipFile(stream, "w") as archive:
            archive.writestr(entry("x"), b"content")
            archive.infolist()[0].flag_bits |= 1
        seal_zip(stream)
    assert "must contain no encrypted file, but 'x' is encrypted" in refusal(file)


def test_the_whole_is_bounded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = write(tmp_path / "a.zip", *((entry(f"{i}"), bytes(10)) for i in range(5)))
    monkeypatch.setattr(zipped, "LARGEST", 49)
    assert "unpack to" in refusal(file)
    monkeypatch.setattr(zipped, "LARGEST", 50)
    monkeypatch.setattr(zipped, "MOST_MEMBERS", 4)
    assert "at most 4 files, not 5" in refusal(file)


def truncated(content: bytes) -> bytes:
    return content[:-10]


def swollen(content: bytes) -> bytes:
    """The directory states fewer packed bytes than there are, and more unpacked ones."""
    place = content.rindex(b"PK\x01\x02")
    return content[: place + 24] + (500).to_bytes(4, "little") + content[place + 28 :]


@pytest.mark.parametrize(
    "change",
    [
        truncated,
        swollen,
        lambda content: b"",
        lambda content: b"no zip",
        lambda content: content + b"more",
        lambda content: b"before" + content,
        lambda content: content.replace(b"evoros", b"others"),
    ],
)
def test_a_damaged_file_is_one_line(change: Callable[[bytes], bytes], tmp_path: Path) -> None:
    file = write(tmp_path / "a.zip", (entry("x"), b"content"))
    file.write_bytes(change(file.read_bytes()))
    refusal(file)


def test_a_link_and_a_folder_are_no_zip_file(tmp_path: Path) -> None:
    write(tmp_path / "a.zip", (entry("x"), b""))
    (tmp_path / "b.zip").symlink_to(tmp_path / "a.zip")
    for path in (tmp_path / "b.zip", tmp_path, tmp_path / "none.zip"):
        with pytest.raises(InputError, match="cannot be read"), open_zip(path):
            pass


@given(st.dictionaries(st.from_regex(r"[a-z]{1,3}(/[a-z]{1,2})?", fullmatch=True), st.binary()))
def test_what_is_written_is_read(files: dict[str, bytes]) -> None:
    from tempfile import TemporaryDirectory

    tops = {name.partition("/")[0] for name in files if "/" in name}
    kept = {name: content * 1000 for name, content in files.items() if name not in tops}
    written = []
    for _ in range(2):
        buffer = BytesIO()
        with ZipFile(buffer, "w") as archive:
            for name, content in kept.items():
                add_member(archive, name, content)
            add_folder(archive, "folder")
        seal_zip(buffer)
        written.append(buffer.getvalue())
    assert written[0] == written[1]
    with TemporaryDirectory() as folder:
        file = Path(folder) / "a.zip"
        file.write_bytes(written[0])
        with open_zip(file) as (archive, members):
            assert {n: read_member(file, archive, m) for n, m in members.items()} == kept


def test_what_packs_too_well_is_stored(tmp_path: Path) -> None:
    """So that no file that evoros writes is taken for a bomb."""
    with (tmp_path / "a.zip").open("w+b") as file:
        with ZipFile(file, "w") as archive:
            add_member(archive, "zeros", bytes(2**22))
        seal_zip(file)
    with open_zip(tmp_path / "a.zip") as (_, members):
        assert members["zeros"].compress_size == 2**22
