"""Serialized FMU states, changed and signed anew: what no host can do by accident."""

import hashlib
import json
import struct
from collections.abc import Callable
from typing import Any

from hovercraft_fmu.fmu.block import checksum

MAGIC = b"HOVERFMU"
DIGEST, BUILD, SUBSTEPS = slice(64), slice(12, 44), 44
"""Python: the hexadecimal digest ahead. Native, as serialize.c says: where the build and the first integer stand."""


def with_build(blob: bytes, build: str) -> bytes:
    """As another build would have written it."""
    if blob.startswith(MAGIC):
        return signed(blob[: BUILD.start] + build.encode() + blob[BUILD.stop :])
    return _rewritten(blob, lambda saved: saved.update(build=build))


def with_substeps(blob: bytes, count: int) -> bytes:
    """With another count of sub-steps."""
    if blob.startswith(MAGIC):
        return signed(blob[:SUBSTEPS] + struct.pack("<i", count) + blob[SUBSTEPS + 4 :])
    return _rewritten(blob, lambda saved: saved["integers"].__setitem__(0, count))


def with_word(blob: bytes, offset: int, word: int) -> bytes:
    """A native state with other four bytes somewhere, and the checksum right again."""
    return signed(blob[:offset] + struct.pack("<I", word) + blob[offset + 4 :])


def _rewritten(blob: bytes, change: Callable[[dict[str, Any]], object]) -> bytes:
    saved = json.loads(blob[DIGEST.stop :])
    change(saved)
    text = json.dumps(saved).encode()
    return hashlib.sha256(text).hexdigest().encode() + text


def signed(blob: bytes) -> bytes:
    """With the checksum right again."""
    return blob[:-8] + struct.pack("<Q", checksum(blob[:-8]))
