"""The block in a native library that says which FMU it is: build, GUID, start values. Written there without a compiler.

`struct variant` of variables.h, little-endian as all platforms are: mark, size, digest of the code that it belongs to,
build, GUID, a start value for each value reference, and a checksum, FNV-1a, of all before.
"""

import struct
from dataclasses import dataclass

from .mach_o import is_mach_o, renamed, signed
from .variable import Model

MARK = b"HOVERCRAFT START"
HEAD = struct.Struct("<16sQ40s40s40s")
WORD = 8
"""Bytes of a start value, and of the checksum."""


@dataclass(frozen=True)
class Block:
    """Which FMU of some code it is."""

    code: str
    """32 hexadecimal digits: the digest of the code."""
    build: str
    """The same of the whole; an FMU that is no variant is its code."""
    starts: tuple[float, ...]
    """By value reference; 0 where a variable has none."""

    @property
    def guid(self) -> str:
        """The build in the shape of a GUID."""
        return guid(self.build)

    @property
    def size(self) -> int:
        """Bytes."""
        return HEAD.size + WORD * (len(self.starts) + 1)

    def content(self) -> bytes:
        """As it stands in a library."""
        content = self._checked()
        return content + struct.pack("<Q", checksum(content))

    @property
    def checksum(self) -> int:
        """Of all before it."""
        return checksum(self._checked())

    def _checked(self) -> bytes:
        head = HEAD.pack(MARK, self.size, self.code.encode(), self.build.encode(), self.guid.encode())
        return head + struct.pack(f"<{len(self.starts)}d", *self.starts)


def block(model: Model, build: str, code: str) -> Block:
    """The block of the FMU of a model."""
    starts = [0.0] * (1 + max(model.by_reference))
    for variable in model.variables:
        starts[variable.reference] = float(variable.start or 0.0)
    return Block(code, build, tuple(starts))


def guid(build: str) -> str:
    """A digest in the shape of a GUID."""
    return f"{{{build[:8]}-{build[8:12]}-{build[12:16]}-{build[16:20]}-{build[20:32]}}}"


def checksum(content: bytes) -> int:
    """FNV-1a, 64 bits: no change of a single byte escapes it."""
    total = 0xCBF29CE484222325
    for byte in content:
        total = (total ^ byte) * 0x100000001B3 % 2**64
    return total


def patched(library: bytes, own: Block, file: str) -> bytes:
    """The library with another block in it, under the name of another file; a Mach-O library is signed again.

    Raises:
        ValueError: there is not one whole block of that code in it.
    """
    places = library.count(MARK)
    if places != 1:
        raise ValueError(f"{file}: {places} blocks of start values: must be one in the library that it is made from")
    at = library.index(MARK)
    old = library[at : at + own.size]
    if old[-WORD:] != struct.pack("<Q", checksum(old[:-WORD])) or HEAD.unpack_from(old)[1] != own.size:
        raise ValueError(f"{file}: the start values in the library that it is made from must be complete and unchanged")
    code = HEAD.unpack_from(old)[2].rstrip(b"\0").decode()
    if code != own.code:
        raise ValueError(f"{file}: the library that it is made from is of code {code}: must be of {own.code}")
    content = library[:at] + own.content() + library[at + own.size :]
    return signed(renamed(content, file)) if is_mach_o(content) else content
