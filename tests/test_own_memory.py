"""What stands in for a C library in a browser, and mostly on Windows: memory, and functions of bytes and strings."""

import shutil
from ctypes import CDLL, addressof, c_char_p, c_int, c_size_t, c_void_p, create_string_buffer, memset, string_at
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercraft_fmu.fmu.machine_code import c_file
from tests.native import C_TESTS, compile_c

PAGES, PAGE, HEAD = 16, 65536, 16
"""Of own_memory.h, all that there is; and bytes that a block takes beside its own."""
TYPES: dict[str, tuple[Any, ...]] = {
    "memory_allocate": (c_void_p, c_size_t), "memory_release": (None, c_void_p),
    "own_memcpy": (c_void_p, c_void_p, c_char_p, c_size_t), "own_memset": (c_void_p, c_void_p, c_int, c_size_t),
    "own_memcmp": (c_int, c_char_p, c_char_p, c_size_t), "own_strlen": (c_size_t, c_char_p),
    "own_strcmp": (c_int, c_char_p, c_char_p),
}  # fmt: skip
"""Of each function: what it returns, what it takes."""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    options = ("-include", str(C_TESTS / "own_memory.h"), "-DHOVERCRAFT_NO_LIBC", "-D__wasm__", "-Wno-attributes")
    path = tmp_path_factory.mktemp("memory") / "memory.so"
    return compile_c(path, [c_file("memory.c")], *options, "-shared", "-fPIC")


def loaded(path: Path) -> Any:
    library = CDLL(str(path))
    for name, (returned, *taken) in TYPES.items():
        function = getattr(library, name)
        function.restype, function.argtypes = returned, taken
    return library


@pytest.fixture(scope="module")
def library(compiled: Path) -> Any:
    return loaded(compiled)


@pytest.fixture
def untouched(compiled: Path, tmp_path: Path) -> Any:
    """One that has all its pages yet."""
    return loaded(Path(shutil.copy(compiled, tmp_path)))


def order(one: bytes, other: bytes) -> int:
    return (one > other) - (one < other)


def sign(number: int) -> int:
    return (number > 0) - (number < 0)


@given(st.binary(max_size=40), st.binary(max_size=40), st.integers(0, 3), st.integers(-1, 256))
def test_bytes(library: Any, one: bytes, other: bytes, first: int, value: int) -> None:
    """They compare as numbers from 0 to 255; nothing beside those that are meant is touched."""
    n = min(len(one), len(other))
    place = create_string_buffer(b"#" * 48, 48)
    at, before, behind = addressof(place) + first, b"#" * first, b"#" * (48 - first - len(one))
    assert library.own_memcpy(at, one, len(one)) == at
    assert place.raw == before + one + behind
    assert library.own_memset(at, value, n) == at
    assert place.raw == before + bytes([value % 256]) * n + one[n:] + behind
    assert sign(library.own_memcmp(one, other, n)) == order(one[:n], other[:n])


TEXTS = st.binary(max_size=12).filter(lambda text: 0 not in text)


@given(TEXTS, TEXTS, TEXTS)
def test_strings(library: Any, both: bytes, one: bytes, other: bytes) -> None:
    one, other = both + one, both + other
    assert library.own_strlen(one) == len(one)
    assert sign(library.own_strcmp(one, other)) == order(one, other)
    assert library.own_strcmp(one, one) == 0


@pytest.mark.parametrize(("size", "most"), [(PAGE - HEAD, PAGES), (PAGE - HEAD + 1, PAGES // 2)])
def test_memory_is_zero_and_each_blocks_own(size: int, most: int, untouched: Any) -> None:
    """Whole pages, as many as there are; the one behind says so. What comes back is zero again, the rest stays."""
    blocks = [untouched.memory_allocate(size) for _ in range(most)]
    assert all(blocks)
    assert untouched.memory_allocate(size) is None
    for number, block in enumerate(blocks, 1):
        assert string_at(block, size) == bytes(size)
        memset(block, number, size)
    for number in (3, 1, 5):
        untouched.memory_release(blocks[number])
    for _ in range(3):
        blocks.append(untouched.memory_allocate(size))
        assert string_at(blocks[-1], size) == bytes(size)
    assert sorted(blocks[-3:]) == sorted(blocks[number] for number in (1, 3, 5))
    assert untouched.memory_allocate(1) is None
    kept = [number for number in range(most) if number not in (1, 3, 5)]
    assert all(string_at(blocks[number], size) == bytes([number + 1]) * size for number in kept)


def test_what_was_given_back_is_large_enough(untouched: Any) -> None:
    """For what it was made for, not for more; no memory at all can be given back, too."""
    small, large = (untouched.memory_allocate(pages * PAGE - HEAD) for pages in (1, 2))
    for block in (small, large, None):
        untouched.memory_release(block)
    assert untouched.memory_allocate(2 * PAGE - HEAD) == large
    assert untouched.memory_allocate(PAGE) not in (small, None)
    assert untouched.memory_allocate(2) == small


def test_a_block_that_is_made_again_and_again_takes_no_more(untouched: Any) -> None:
    first = untouched.memory_allocate(8000)
    for _ in range(1000):
        untouched.memory_release(first)
        assert untouched.memory_allocate(8000) == first
    assert untouched.memory_allocate(2 * PAGE * PAGES) is None
    assert untouched.memory_allocate((PAGES - 2) * PAGE)
