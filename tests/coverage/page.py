"""Blocks of the page's JavaScript, as Chromium counts them: a block is what runs as often as its first character does,
a function, a way of an if, of a ?:, of an && or ||. It is taken where any window of the run has counted it.

A page has its modules in one script: each is found in it by its text.
"""

import hashlib
import json
import re
import shutil
import uuid
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import numpy as np

from hovercraft_fmu.view.page import FOLDER, IMPORT, module_text
from tests.browsers import NAMES
from tests.coverage.branches import ROOT, Branch, Taken
from tests.coverage.python import PLUGIN

VARIABLE = "PAGE_COVERAGE"
"""The folder that takes what Chromium counted."""
SCRIPT = re.compile(r'<script type="module">(.*?)</script>', re.DOTALL)
Block = tuple[int, int]
"""Where it begins and ends in a module's text."""


class Page:
    """the JavaScript of the page"""

    goal: Sequence[str] = ()

    def __init__(self, tree: Path) -> None:
        self.counts = tree.parent / "page"
        self.counts.mkdir()

    @staticmethod
    def missing() -> str:
        """Why it cannot be measured here."""
        return "" if any(map(shutil.which, NAMES)) else f"no Chromium ({', '.join(NAMES)})"

    def environment(self, test_file: Path) -> Mapping[str, str]:  # noqa: ARG002 - all files alike
        """Of pytest: its plugin has the windows count."""
        return {**PLUGIN, VARIABLE: str(self.counts)}

    def taken(self) -> Taken:
        """Of the modules as they are in the tree."""
        scripts: dict[str, list[Any]] = {}
        for path in sorted(self.counts.glob("*.json")):
            scripts.setdefault(path.name.split(".")[0], []).append(json.loads(path.read_text(encoding="utf-8")))
        taken: dict[Branch, bool] = {}
        for path in sorted(FOLDER.glob("*.js")):
            module = _Module(path.read_text(encoding="utf-8"))
            for name, runs in scripts.items():
                module.count((self.counts / f"{name}.js").read_text(encoding="utf-8"), runs)
            taken |= module.branches(path.relative_to(ROOT).as_posix())
        return taken


def count_in_windows(folder: Path) -> None:
    """From now on every window that is opened from this process counts, and tells when it leaves a page."""
    from playwright.sync_api import Browser, BrowserContext
    from playwright.sync_api import Page as Window

    go, close = Window.goto, BrowserContext.close
    sessions: dict[Window, Any] = {}

    def counting(open_window: Callable[..., Window]) -> Callable[..., Window]:
        def opened(owner: Browser | BrowserContext, **options: Any) -> Window:
            page = open_window(owner, **options)
            sessions[page] = session = page.context.new_cdp_session(page)
            session.send("Profiler.enable")
            session.send("Profiler.startPreciseCoverage", {"callCount": True, "detailed": True})
            return page

        return opened

    def leave(page: Window) -> None:
        for counted in sessions[page].send("Profiler.takePreciseCoverage")["result"]:
            _keep(counted, folder)

    def left(page: Window, url: str, **options: Any) -> Any:
        leave(page)
        return go(page, url, **options)

    def closed(context: BrowserContext) -> None:
        for page in context.pages:
            leave(page)
        close(context)

    for kind, name, function in (
        (Browser, "new_page", counting(Browser.new_page)),
        (BrowserContext, "new_page", counting(BrowserContext.new_page)),
        (BrowserContext, "close", closed),
        (Window, "goto", left),
    ):
        setattr(kind, name, function)


def _keep(counted: Mapping[str, Any], folder: Path) -> None:
    """What was counted in a script, beside the text of it; scripts of a test itself have no address."""
    if not counted["url"].startswith("file:"):
        return
    script = SCRIPT.search(Path(unquote(urlsplit(counted["url"]).path)).read_text(encoding="utf-8"))
    if script:
        text = folder / f"{hashlib.sha256(script[1].encode()).hexdigest()[:16]}.js"
        text.write_text(script[1], encoding="utf-8")
        name = f"{text.stem}.{uuid.uuid4().hex}.json"
        (folder / name).write_text(json.dumps([each["ranges"] for each in counted["functions"]]), encoding="utf-8")


class _Module:
    """Of the page: its text as it stands in the page's script, and what was counted in it."""

    def __init__(self, source: str) -> None:
        imports = [range(*each.span()) for each in IMPORT.finditer(source)]
        starts = [0, *(each.end() for each in re.finditer("\n", source))]
        self.numbers = [n for n, start in enumerate(starts, 1) if not any(start in each for each in imports)]
        self.text = module_text(source)
        self.taken = np.zeros(len(self.text), bool)
        self.blocks: set[Block] = set()

    def count(self, script: str, runs: list[Any]) -> None:
        """Ranges lie in one another, the outer ones first; the first one of all is the script itself."""
        first = script.find(self.text)
        if first < 0:
            return
        last = first + len(self.text)
        for run in runs:
            taken = np.zeros(len(script), bool)
            for each in (each for function in run for each in function):
                start, end = each["startOffset"], each["endOffset"]
                taken[start:end] = each["count"] > 0
                if first <= start < end <= last and script[start:end].strip(" \n;})]"):
                    self.blocks.add((start - first, end - first))
            self.taken |= taken[first:last]

    def branches(self, file: str) -> Taken:
        """Each block, by its first character."""
        return {Branch(file, *self._place(start), "block"): bool(self.taken[start]) for start, _ in sorted(self.blocks)}

    def _place(self, at: int) -> tuple[int, int]:
        """Line and column, from 1, in the module's file."""
        return self.numbers[self.text.count("\n", 0, at)], at - self.text.rfind("\n", 0, at)
