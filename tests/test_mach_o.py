"""Libraries of macOS that are put together here: name, signature and slices (Apple, `mach-o/*.h`, `cs_blobs.h`)."""

import hashlib
import struct

import pytest

from hovercraft_fmu.fmu.mach_o import is_mach_o, renamed, signed, universal
from tests.binaries import dylib, slices

X86_64, ARM64 = (0x01000007, 3), (0x0100000C, 0)
"""CPU type and subtype."""
FIRST, LIMIT, PAGE = 1024, 3000, 256
"""Where the first section begins, where the signature does, and the bytes of its pages."""


def library(cpu: tuple[int, int] = ARM64, name: str = "@rpath/old.dylib") -> bytes:
    """With a section, an empty one, a name and a signature whose hashes are not made yet."""
    text = name.encode() + b"\0" * (8 - len(name) % 8)
    sections = b"".join(struct.pack("<32x2QI28x", 0, size, place) for size, place in ((LIMIT - FIRST, FIRST), (0, 0)))
    commands = [
        struct.pack("<2I16s4Q4I", 0x19, 72 + len(sections), b"__TEXT", 0, LIMIT, 0, LIMIT, 5, 5, 2, 0) + sections,
        struct.pack("<6I", 0xD, 24 + len(text), 24, 2, 0, 0) + text,
        struct.pack("<4I", 0x1D, 16, LIMIT, 600),
    ]
    head = struct.pack("<8I", 0xFEEDFACF, *cpu, 6, len(commands), sum(map(len, commands)), 0x85, 0) + b"".join(commands)
    content = head + bytes(FIRST - len(head)) + bytes(i % 251 for i in range(LIMIT - FIRST))
    slots = -(-LIMIT // PAGE)
    directory = struct.pack(">9I4B4x", 0xFADE0C02, 44 + 32 * slots, 0x20100, 2, 44, 0, 0, slots, LIMIT, 32, 2, 0, 8)
    blob = struct.pack(">7I", 0xFADE0CC0, 0, 2, 0, 36, 2, 28) + struct.pack(">2I", 0xFADE0C01, 8)
    return content + blob + directory + bytes(32 * slots) + b"behind"


def test_a_name_and_nothing_else_is_another() -> None:
    before = library()
    for file in ("a.dylib", "old.dylib", "a_longer_name_than_it_had.dylib"):
        after = renamed(before, file)
        assert is_mach_o(after)
        assert dylib(after)._replace(name="") == dylib(before)._replace(name="")
        assert dylib(after).name == f"@rpath/{file}"
        assert after[FIRST:] == before[FIRST:]
        assert renamed(before, "old.dylib") == before
    assert renamed(renamed(before, "a_longer_name_than_it_had.dylib"), "old.dylib") == before


def test_a_name_may_fill_the_room_to_the_first_section() -> None:
    before = library()
    room = FIRST - 32 - struct.unpack_from("<I", before, 20)[0]
    longest = 24 + room - len("@rpath/.dylib\0")  # 24: of the old name, with zeros behind it
    after = renamed(before, f"{'n' * longest}.dylib")
    assert dylib(after).name == f"@rpath/{'n' * longest}.dylib"
    assert after[FIRST:] == before[FIRST:]
    with pytest.raises(ValueError, match=r"^n+\.dylib: must be a shorter name"):
        renamed(before, f"{'n' * (longest + 1)}.dylib")


def test_each_page_has_its_hash() -> None:
    """The last one up to where the signature begins; the rest of it stays as it was."""
    before = library()
    after = signed(before)
    hashes = before.index(struct.pack(">I", 0xFADE0C02)) + 44
    pages = [after[i : min(i + PAGE, LIMIT)] for i in range(0, LIMIT, PAGE)]
    assert after[hashes:] == b"".join(hashlib.sha256(page).digest() for page in pages) + b"behind"
    assert after[:hashes] == before[:hashes]
    assert signed(after) == after


def test_a_universal_file_has_every_slice_as_it_was() -> None:
    """Of any length and kind; each begins on a page."""
    parts = [library(X86_64) + b"#" * 5, library(ARM64) + b"#" * (1 << 14), library(ARM64, "@rpath/x.dylib")]
    made = universal(parts)
    assert slices(made) == parts
    places = [struct.unpack_from(">5I", made, 8 + 20 * i)[2] for i in range(3)]
    assert [place % (1 << 14) for place in places] == [0, 0, 0]
    assert places == sorted(places)
    assert len(made) == places[-1] + len(parts[-1])
