"""Libraries of macOS: one file for both kinds of Mac (Apple, `mach-o/fat.h`), install name, ad-hoc signature."""

import hashlib
import struct
from collections.abc import Iterator, Sequence

FAT_MAGIC = 0xCAFEBABE
ALIGNMENT = 14
"""Slices begin at multiples of 2^14 bytes, a page of an arm64 Mac."""
HEADER, ENTRY = struct.Struct(">2I"), struct.Struct(">5I")
CPU = struct.Struct("<4x2I")
"""Of a 64-bit little-endian Mach-O file: CPU type and subtype behind the magic number."""


def universal(slices: Sequence[bytes]) -> bytes:
    """The universal file of these Mach-O files."""
    page = 1 << ALIGNMENT
    header, content = HEADER.pack(FAT_MAGIC, len(slices)), bytes(page)
    for one in slices:
        content += bytes(-len(content) % page)
        cpu, subtype = CPU.unpack_from(one)
        header += ENTRY.pack(cpu, subtype, len(content), len(one), ALIGNMENT)
        content += one
    return header + content[len(header) :]


# ---- of one slice, 64-bit and little-endian (Apple, `mach-o/loader.h` and `cs_blobs.h`)

MAGIC = b"\xcf\xfa\xed\xfe"
COMMANDS = 32
"""Where the load commands begin."""
SEGMENT, NAME, SIGNATURE = 0x19, 0xD, 0x1D
"""Load commands: LC_SEGMENT_64, LC_ID_DYLIB, LC_CODE_SIGNATURE."""
CODE_DIRECTORY, SHA_256 = 0xFADE0C02, 2


def is_mach_o(content: bytes) -> bool:
    """Whether it is a slice."""
    return content.startswith(MAGIC)


def _commands(content: bytes) -> Iterator[tuple[int, int, int]]:
    """(kind, place, size) of every load command."""
    at = COMMANDS
    for _ in range(struct.unpack_from("<I", content, 16)[0]):
        kind, size = struct.unpack_from("<2I", content, at)
        yield kind, at, size
        at += size


def renamed(content: bytes, file: str) -> bytes:
    """The library under the install name @rpath/`file`. It must then be signed again.

    Raises:
        ValueError: there is no room for the name ahead of the first section.
    """
    commands = list(_commands(content))
    at, size = next((at, size) for kind, at, size in commands if kind == NAME)
    end = commands[-1][1] + commands[-1][2]
    name = f"@rpath/{file}\0".encode()
    head, text = content[at : at + 24], name + bytes(-len(name) % 8)
    new = struct.pack("<2I", NAME, len(head) + len(text)) + head[8:] + text
    moved = content[:at] + new + content[at + size : end]
    if len(moved) > _first_section(content):
        raise ValueError(f"{file}: must be a shorter name: the Mach-O library has no room for it")
    sized = moved[:20] + struct.pack("<I", len(moved) - COMMANDS) + moved[24:]
    rest = max(end, len(moved))
    return sized + bytes(rest - len(moved)) + content[rest:]


def _first_section(content: bytes) -> int:
    """Where the first section of the file begins: up to there load commands may grow."""
    places: list[int] = []
    for kind, at, _ in _commands(content):
        if kind == SEGMENT:
            count = struct.unpack_from("<I", content, at + 64)[0]
            places += [struct.unpack_from("<I", content, at + 72 + 80 * i + 48)[0] for i in range(count)]
    return min(place for place in places if place)


def signed(content: bytes) -> bytes:
    """The library with the hashes of its pages as they are now, in the ad-hoc signature that it has; else unchanged."""
    whole = bytearray(content)
    for kind, at, _ in _commands(content):
        if kind == SIGNATURE:
            start = struct.unpack_from("<I", content, at + 8)[0]
            for i in range(struct.unpack_from(">I", content, start + 8)[0]):
                place = start + struct.unpack_from(">I", content, start + 16 + 8 * i)[0]
                if struct.unpack_from(">I", content, place)[0] == CODE_DIRECTORY:
                    _hash_pages(whole, place)
    return bytes(whole)


def _hash_pages(whole: bytearray, directory: int) -> None:
    """Write the hashes of the pages into a code directory."""
    hashes = struct.unpack_from(">I", whole, directory + 16)[0]
    slots, limit = struct.unpack_from(">2I", whole, directory + 28)
    size, kind, _, page = struct.unpack_from(">4B", whole, directory + 36)
    if kind != SHA_256:
        raise ValueError(f"signature of a Mach-O library: hashes of type {kind}: must be SHA-256, {SHA_256}")
    for i in range(slots):
        first = i << page
        hashed = hashlib.sha256(whole[first : min(first + (1 << page), limit)]).digest()
        place = directory + hashes + size * i
        whole[place : place + size] = hashed[:size]
