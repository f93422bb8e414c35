"""What a library says of itself, read from the file: names it exports, what it needs, how it is signed."""

import re
import struct
from collections.abc import Iterator
from typing import NamedTuple


class Elf(NamedTuple):
    """A shared library of Linux."""

    machine: int
    exports: set[str]
    undefined: set[str]
    needed: set[str]
    glibc: tuple[int, int]
    """The newest version of a symbol that it asks for."""


def elf(content: bytes) -> Elf:
    """Of a 64-bit little-endian file (System V ABI: section headers, dynamic symbols)."""
    assert content[:6] == b"\x7fELF\x02\x01"
    machine, sections = struct.unpack_from("<H", content, 18)[0], _elf_sections(content)
    exports, undefined, needed = set(), set(), set()
    for kind, offset, size, strings in sections:
        if kind == 11:  # SHT_DYNSYM
            for at in range(offset, offset + size, 24):
                name, info, _, section = struct.unpack_from("<IBBH", content, at)
                text = _text(content, strings + name)
                if section and info >> 4 == 1:
                    exports.add(text)
                elif text and info >> 4 == 1:
                    undefined.add(text)
        elif kind == 6:  # SHT_DYNAMIC
            for at in range(offset, offset + size, 16):
                tag, value = struct.unpack_from("<QQ", content, at)
                if tag == 1:
                    needed.add(_text(content, strings + value))
    versions = [(int(major), int(minor)) for major, minor in re.findall(rb"GLIBC_(\d+)\.(\d+)", content)]
    return Elf(machine, exports, undefined, needed, max(versions, default=(0, 0)))


def _elf_sections(content: bytes) -> list[tuple[int, int, int, int]]:
    """(type, offset, size, offset of its strings) of every section."""
    start, size, count = *struct.unpack_from("<Q", content, 40), *struct.unpack_from("<HH", content, 58)
    raw = [struct.unpack_from("<IIQQQQI", content, start + i * size) for i in range(count)]
    return [(kind, offset, length, raw[link][4]) for _, kind, _, _, offset, length, link in raw]


class Dll(NamedTuple):
    """A library of Windows."""

    machine: int
    exports: set[str]
    needed: set[str]


def dll(content: bytes) -> Dll:
    """Of a PE32+ file (Microsoft, PE format)."""
    start = struct.unpack_from("<I", content, 0x3C)[0]
    assert content[start : start + 4] == b"PE\0\0"
    machine, count = struct.unpack_from("<HH", content, start + 4)
    optional = start + 24
    sections = optional + struct.unpack_from("<H", content, start + 20)[0]
    table = [struct.unpack_from("<8sIIII", content, sections + 40 * i) for i in range(count)]

    def at(address: int) -> int:
        found = (address - virtual + raw for _, size, virtual, _, raw in table if virtual <= address < virtual + size)
        return int(next(found))

    exported, imported = (struct.unpack_from("<I", content, optional + 112 + 8 * i)[0] for i in range(2))
    names, _, listed = struct.unpack_from("<III", content, at(exported) + 24)
    pointers = struct.unpack_from(f"<{names}I", content, at(listed))
    needed = set()
    for entry in range(at(imported), len(content), 20):
        name = struct.unpack_from("<I", content, entry + 12)[0]
        if not name:
            break
        needed.add(_text(content, at(name)))
    return Dll(machine, {_text(content, at(pointer)) for pointer in pointers}, needed)


class Dylib(NamedTuple):
    """A library of macOS, one slice."""

    cpu: int
    exports: set[str]
    undefined: set[str]
    needed: set[str]
    name: str
    minimum: tuple[int, int]
    """macOS version"""
    signature: bytes


CPU_X86_64, CPU_ARM64 = 0x01000007, 0x0100000C


def slices(content: bytes) -> list[bytes]:
    """The parts of a universal file."""
    magic, count = struct.unpack_from(">II", content)
    assert magic == 0xCAFEBABE
    parts = []
    for i in range(count):
        cpu, subtype, offset, size, alignment = struct.unpack_from(">5I", content, 8 + 20 * i)
        assert offset % (1 << alignment) == 0
        part = content[offset : offset + size]
        assert len(part) == size
        assert struct.unpack_from("<2I", part, 4) == (cpu, subtype)
        parts.append(part)
    return parts


def dylib(content: bytes) -> Dylib:
    """Of a 64-bit little-endian Mach-O library (Apple, `mach-o/loader.h`)."""
    magic, cpu, _, kind = struct.unpack_from("<4I", content)
    assert (magic, kind) == (0xFEEDFACF, 6)  # MH_DYLIB
    exports: set[str] = set()
    undefined: set[str] = set()
    needed, name, minimum, signature = set(), "", (0, 0), b""
    for command, at in _commands(content):
        if command == 0xD:  # LC_ID_DYLIB
            name = _text(content, at + struct.unpack_from("<I", content, at + 8)[0])
        elif command == 0xC:  # LC_LOAD_DYLIB
            needed.add(_text(content, at + struct.unpack_from("<I", content, at + 8)[0]))
        elif command == 0x32:  # LC_BUILD_VERSION
            version = struct.unpack_from("<I", content, at + 12)[0]
            minimum = (version >> 16, version >> 8 & 0xFF)
        elif command == 0x1D:  # LC_CODE_SIGNATURE
            offset, size = struct.unpack_from("<II", content, at + 8)
            signature = content[offset : offset + size]
        elif command == 0x2:  # LC_SYMTAB
            offset, count, strings = struct.unpack_from("<III", content, at + 8)
            for i in range(count):
                text, how = struct.unpack_from("<IB", content, offset + 16 * i)
                if how & 1 and not how & 0x10:  # external, and not private
                    (undefined if how & 0xE == 0 else exports).add(_text(content, strings + text))
    return Dylib(cpu, exports, undefined, needed, name, minimum, signature)


def _commands(content: bytes) -> Iterator[tuple[int, int]]:
    at = 32
    for _ in range(struct.unpack_from("<I", content, 16)[0]):
        command, size = struct.unpack_from("<II", content, at)
        yield command, at
        at += size


def is_ad_hoc_signed(signature: bytes, content: bytes) -> bool:
    """Whether the code directory is ad hoc and every page of the file has the hash that it names (SHA-256)."""
    import hashlib

    magic, _, count = struct.unpack_from(">3I", signature)
    assert magic == 0xFADE0CC0  # an embedded signature: a super blob
    for i in range(count):
        kind, at = struct.unpack_from(">II", signature, 12 + 8 * i)
        if kind == 0:  # the code directory
            flags, hashes = struct.unpack_from(">II", signature, at + 12)
            slots, limit = struct.unpack_from(">II", signature, at + 28)
            size, hash_type, _, page = struct.unpack_from(">4B", signature, at + 36)
            starts = range(0, limit, 1 << page)
            expected = [signature[at + hashes + size * k : at + hashes + size * (k + 1)] for k in range(slots)]
            found = [hashlib.sha256(content[k : min(k + (1 << page), limit)]).digest() for k in starts]
            return bool(flags & 2) and hash_type == 2 and found == expected
    return False


def _text(content: bytes, at: int) -> str:
    return content[at : content.index(b"\0", at)].decode()
