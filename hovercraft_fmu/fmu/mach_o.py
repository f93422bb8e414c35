"""One file for both kinds of Mac: Mach-O slices behind a fat header (Apple, `mach-o/fat.h`)."""

import struct
from collections.abc import Sequence

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
