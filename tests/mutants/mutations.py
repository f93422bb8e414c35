"""What can be changed in a file: every mutant of it, in the order of its text.

Strings, comments, docstrings, annotations, assertions and include guards stay as they are: texts say something, and
decide nothing.
"""

import ast
import hashlib
import io
import itertools
import re
import tokenize
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeAlias

Span: TypeAlias = Callable[[ast.expr | ast.stmt], tuple[int, int]]


class Change(NamedTuple):
    """Of a text: from one offset to another, something else instead."""

    operator: str
    start: int
    end: int
    text: str


@dataclass(frozen=True)
class Mutant:
    """One change of one file. Its name stays the same while its line does, wherever the line moves."""

    file: str
    """Below the root of the project, with `/`."""
    line: int
    operator: str
    before: str
    """The line or lines."""
    after: str
    number: int
    """Of those alike in the file."""
    change: Change

    @property
    def name(self) -> str:
        number = f" ({self.number + 1})" if self.number else ""
        return f"{self.file}: {self.before} -> {self.after} [{self.operator}]{number}"

    def rank(self, seed: int) -> str:
        """The sample of N is made of those of the N lowest."""
        return hashlib.sha256(f"{seed} {self.name}".encode()).hexdigest()

    def applied(self, source: str) -> str:
        return source[: self.change.start] + self.change.text + source[self.change.end :]


def mutants(root: Path, file: str) -> list[Mutant]:
    """All of a file of C or Python. Raises OSError, SyntaxError."""
    source = (root / file).read_text(encoding="utf-8")
    found, seen = [], Counter[tuple[str, str, str]]()
    changes = _of_python(source) if file.endswith(".py") else _of_c(source)
    for change in sorted(set(changes), key=lambda each: (each.start, each.end, each.operator, each.text)):
        first = source.rfind("\n", 0, change.start) + 1
        last = source.find("\n", change.end)
        before = source[first:last]
        after = source[first : change.start] + change.text + source[change.end : last]
        key = change.operator, _short(before), _short(after)
        line = source.count("\n", 0, change.start) + 1
        found.append(Mutant(file, line, *key, seen[key], change))
        seen[key] += 1
    return found


def _short(text: str) -> str:
    return " ".join(text.split())


# ---- both languages

SWAPPED = {
    "+": ("-",), "-": ("+",), "*": ("/",), "/": ("*",), "//": ("/",), "%": ("*",), "**": ("*",),
    "+=": ("-=",), "-=": ("+=",), "*=": ("/=",), "/=": ("*=",), "|=": ("&=",), "&=": ("|=",),
    "++": ("--",), "--": ("++",),
    "<": ("<=", ">="), "<=": ("<", ">"), ">": (">=", "<="), ">=": (">", "<"), "==": ("!=",), "!=": ("==",),
    "&&": ("||",), "||": ("&&",), "&": ("|",), "|": ("&",), "^": ("|",), "<<": (">>",), ">>": ("<<",),
    "and": ("or",), "or": ("and",), "in": ("not in",), "is": ("is not",), "true": ("false",), "false": ("true",),
    "True": ("False",), "False": ("True",), "break": ("continue",), "continue": ("break",),
}  # fmt: skip
"""Operators and words, and what each becomes: of comparisons the limit, and the opposite."""
SIGNS = {"-": "", "!": "", "~": "", "not": ""}
"""What stands before a value, and is dropped."""
KINDS = {"<": "comparison", ">": "comparison", "=": "comparison", "!": "comparison", "&&": "logical", "||": "logical"}


def _swaps(token: str, start: int) -> Iterator[Change]:
    for other in SWAPPED.get(token, ()):
        kind = KINDS.get(token, "operator" if token[-1] == "=" and token[0] in "+-*/|&" else KINDS.get(token[0], ""))
        kind = kind or ("word" if token.isalpha() else "operator")
        yield Change(kind, start, start + len(token), other)


def _numbers(token: str, start: int) -> Iterator[Change]:
    """One more; of a float the other sign, and a tenth more."""
    end = start + len(token)
    plain = token.rstrip("uUlL")
    tail = token[len(plain) :]
    try:
        yield Change("constant", start, end, f"{int(plain, 0) + 1}{tail}")
    except ValueError:
        number = float(plain)
        for other in (-number, 1.1 * number) if number else (1.0,):
            yield Change("constant", start, end, f"{other!r}{tail}")


COMMUTATIVE = ("max", "min", "larger", "smaller", "hypot")
"""Functions whose arguments can stand in either order."""


# ---- Python


def _of_python(source: str) -> Iterator[Change]:
    tree = ast.parse(source)
    starts = [0, *(index + 1 for index, letter in enumerate(source) if letter == "\n")]
    lines = source.splitlines(keepends=True)

    def offset(line: int, column: int) -> int:
        """Of a position of the syntax tree, which counts bytes of UTF-8."""
        return starts[line - 1] + len(lines[line - 1].encode()[:column].decode())

    def span(node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return offset(node.lineno, node.col_offset), offset(node.end_lineno, node.end_col_offset)

    untouched = sorted(span(node) for node in _not_code(tree))

    def is_code(at: int) -> bool:
        return not any(start <= at < end for start, end in untouched)

    for token, at, is_binary in _tokens(source, starts):
        if is_code(at):
            yield from _of_token(token, at, is_binary)
    for change in _of_tree(source, tree, span):
        if is_code(change.start):
            yield change


def _not_code(tree: ast.Module) -> Iterator[ast.expr | ast.stmt]:
    """Annotations, texts, assertions, and what types alone need."""
    for node in ast.walk(tree):
        for name in ("annotation", "returns"):
            if isinstance(part := getattr(node, name, None), ast.expr):
                yield part
        if isinstance(node, ast.Assert | ast.JoinedStr | ast.Import | ast.ImportFrom):
            yield node
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            yield node
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            yield node
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.BinOp) and "TypeAlias" in ast.dump(node):
            yield node


def _tokens(source: str, starts: list[int]) -> Iterator[tuple[str, int, bool]]:
    """Each with its offset, and whether there is a value before it."""
    is_value = False
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type in (tokenize.NL, tokenize.COMMENT):
            continue
        yield token.string, starts[min(token.start[0], len(starts)) - 1] + token.start[1], is_value
        words = ("and", "or", "not", "in", "is", "return", "if", "else", "lambda", "for", "while", "yield", "import")
        is_value = token.type in (tokenize.NAME, tokenize.NUMBER, tokenize.STRING) and token.string not in words
        is_value = is_value or token.string in (")", "]", "}")


def _of_token(token: str, at: int, is_binary: bool) -> Iterator[Change]:
    if token[:1].isdigit() or re.match(r"\.\d", token):
        yield from _numbers(token, at)
    elif token in SIGNS and not is_binary:
        yield Change("sign", at, at + len(token), SIGNS[token])
    elif token not in ("*", "**") or is_binary:
        yield from _swaps(token, at)


def _of_tree(source: str, tree: ast.Module, span: Span) -> Iterator[Change]:
    for node in ast.walk(tree):
        for name in ("body", "orelse", "finalbody"):
            if isinstance(block := getattr(node, name, None), list):
                yield from _of_block(source, block, span)
        if isinstance(node, ast.If | ast.IfExp | ast.While) and not isinstance(node.test, ast.Compare | ast.BoolOp):
            start, end = span(node.test)
            yield Change("condition", start, end, f"(not ({source[start:end]}))")
        elif isinstance(node, ast.Call) and not any(isinstance(each, ast.Starred) for each in node.args):
            if ast.unparse(node.func) in COMMUTATIVE:
                continue
            yield from _exchanged(source, "arguments", [span(each) for each in node.args])
        elif isinstance(node, ast.Return) and node.value is not None and ast.unparse(node.value) != "None":
            yield Change("return", *span(node.value), "None")
        elif isinstance(node, ast.Tuple | ast.List | ast.Set) and len({each.lineno for each in node.elts}) > 2:
            yield from _rows([span(each) for each in node.elts])


def _of_block(source: str, block: list[ast.stmt], span: Span) -> Iterator[Change]:
    simple = ast.Expr | ast.Assign | ast.AugAssign | ast.Raise | ast.Delete | ast.AnnAssign
    for node in block:
        if isinstance(node, simple) and not (isinstance(node, ast.AnnAssign) and node.value is None):
            yield Change("dropped", *span(node), "pass")
    for first, second in itertools.pairwise(block):
        if isinstance(first, simple) and isinstance(second, simple) and _depends(first, second):
            yield from _exchanged(source, "order", [span(first), span(second)])


def _depends(first: ast.stmt, second: ast.stmt) -> bool:
    """Whether one reads what the other sets; where not, their order means nothing."""

    def names(node: ast.stmt, kind: type[ast.expr_context]) -> set[str]:
        return {ast.unparse(each) for each in ast.walk(node) if isinstance(getattr(each, "ctx", None), kind)}

    return bool(names(first, ast.Store) & names(second, ast.Load) or names(second, ast.Store) & names(first, ast.Load))


def _exchanged(source: str, operator: str, spans: list[tuple[int, int]]) -> Iterator[Change]:
    """Each with its neighbour."""
    for (start, end), (next_start, next_end) in itertools.pairwise(spans):
        one, other = source[start:end], source[next_start:next_end]
        if one != other:
            yield Change(operator, start, next_end, other + source[end:next_start] + one)


def _rows(spans: list[tuple[int, int]]) -> Iterator[Change]:
    for (start, _), (following, _) in itertools.pairwise(spans):
        yield Change("row", start, following, "")


# ---- C

C_TOKEN = re.compile(
    r"""(?P<blank>//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'|^\#(?!define)(?:\\\n|[^\n])*
    |^\#define\s+\w+(?:\([^)\n]*\))?|_Static_assert\s*\(.*?\);)
    |(?P<number>(?:\d+\.\d*|\.\d+|\d+)(?:[eE][+-]?\d+)?[uUlLfF]*(?![\w.])|0[xX][\da-fA-F]+[uUlL]*)
    |(?P<word>[A-Za-z_]\w*)|(?P<sign>->|<<=|>>=|\.\.\.|<<|>>|\+\+|--|&&|\|\||[-+*/%&|^<>=!]=|[-+*/%&|^<>=!~?:;,.(){}\[\]\\])""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)
STATEMENT = re.compile(r"(?<=[;{}:)\n\x01])[ \t]*\n[ \t]+(?P<statement>[A-Za-z_*(+-][^;{}]*;)(?=[ \t\x01]*\\?\n)")
DECLARATION = re.compile(
    r"(?:(?:static|const|volatile|struct|enum|unsigned|extern)\b|[A-Za-z_]\w* \*?[A-Za-z_]\w*\s*[=;\[,])"
)
CONDITION = re.compile(r"\b(?:if|while) \((?P<condition>[^()<>=&|]*(?:\([^()]*\)[^()<>=&|]*)*)\)(?=\s)")
CALL = re.compile(
    r"\b(?!if\b|while\b|for\b|switch\b|return\b|sizeof\b)\w+\((?P<arguments>[^(){};]*(?:\([^()]*\)[^(){};]*)*)\)"
)
ROW = re.compile(r"^[ \t]+(?P<row>\[\w+\] = [^;]*?,|\{[^;{}]*\},)[ \t\x01]*$", re.MULTILINE)


def _of_c(source: str) -> Iterator[Change]:
    bare = C_TOKEN.sub(lambda found: re.sub(r"[^\n]", "\x01", found[0]) if found["blank"] else found[0], source)
    for found in C_TOKEN.finditer(source):
        if found["number"]:
            yield from _numbers(found[0], found.start())
        elif found["word"] or found["sign"]:
            yield from _of_c_token(source, found[0], found.start(), found.end())
    for found in CONDITION.finditer(bare):
        yield Change("condition", *found.span("condition"), f"!({source[slice(*found.span('condition'))]})")
    for found in ROW.finditer(bare):
        yield Change("row", *found.span("row"), "")
    for start, end in _bodies(bare):
        yield from _of_c_body(source, bare, start, end)


def _of_c_token(source: str, token: str, start: int, end: int) -> Iterator[Change]:
    """The code is formatted: between two values an operator has a space on either side."""
    is_binary = source[start - 1] == " " and source[end] in " \n"
    if token in SIGNS and not is_binary:
        yield Change("sign", start, end, SIGNS[token])
    elif is_binary or token.isalpha() or token in ("++", "--"):
        yield from _swaps(token, start)


def _bodies(bare: str) -> Iterator[tuple[int, int]]:
    """Of functions, as this code is formatted: between braces at the start of a line."""
    for found in re.finditer(r"^\{\n.*?^\}", bare, re.MULTILINE | re.DOTALL):
        yield found.start(), found.end()


def _of_c_body(source: str, bare: str, start: int, end: int) -> Iterator[Change]:
    statements = []
    for found in STATEMENT.finditer(bare, start, end):
        span = found.span("statement")
        text = found["statement"]
        if text.startswith("return ") or DECLARATION.match(text):
            statements.append((span, text))
        elif text.split("(")[0].strip() not in ("for", "case", "default", "goto"):
            statements.append((span, text))
            yield Change("dropped", *span, ";")
        if text.startswith("return "):
            first, last = span[0] + len("return "), span[1] - 1
            yield Change("return", first, last, f"!({source[first:last]})")
    for (one, text), (other, next_text) in itertools.pairwise(statements):
        if not bare[one[1] : other[0]].strip("\x01 \n") and _c_depends(text, next_text):
            yield from _exchanged(source, "order", [one, other])
    for found in CALL.finditer(bare, start, end):
        if found[0].split("(")[0] not in COMMUTATIVE:
            yield from _exchanged(source, "arguments", _arguments(bare, *found.span("arguments")))


ASSIGNED = re.compile(r"([\w.>-]+)(\[[^\]]*\])? [-+*/|&^]?= ")
NAME = re.compile(r"(\.|->)?\b([A-Za-z_]\w*)")


def _c_depends(one: str, other: str) -> bool:
    """Whether one reads what the other sets, or both set the same; a member is another name than a variable."""

    def names(text: str) -> set[tuple[bool, str]]:
        return {(bool(found[1]), found[2]) for found in NAME.finditer(text)}

    def is_set(text: str) -> set[tuple[bool, str]]:
        return {max(names(found[1]), key=lambda name: found[1].rindex(name[1])) for found in ASSIGNED.finditer(text)}

    def read(text: str) -> set[tuple[bool, str]]:
        return names(ASSIGNED.sub(lambda found: f" {found[2] or ''} ", text))

    same = {found[0] for found in ASSIGNED.finditer(one)} & {found[0] for found in ASSIGNED.finditer(other)}
    return bool(is_set(one) & read(other) or is_set(other) & read(one) or same)


def _arguments(bare: str, start: int, end: int) -> list[tuple[int, int]]:
    """The spans between commas that are in no inner parentheses."""
    spans, depth, first = [], 0, start
    for at in range(start, end + 1):
        depth += {"(": 1, "[": 1, ")": -1, "]": -1}.get(bare[at], 0) if at < end else 0
        if at == end or (bare[at] == "," and depth == 0):
            left = first + len(bare[first:at]) - len(bare[first:at].lstrip())
            spans.append((left, at))
            first = at + 1
    return spans
