"""The pages of all FMUs as a site: a folder that any web server shows as it is."""

import os
import zipfile
from collections.abc import Callable
from html import escape
from pathlib import Path

from ..fmu.document import FOLDER
from ..whole import temporary_folder, write_whole
from . import PRODUCTS, Product

PAGES = "documentation/"
TITLE = "Hovercraft FMU: the pages of each file"


def build_site(folder: str | os.PathLike[str], tell: Callable[[float], None] = lambda _: None) -> Path:
    """Write the pages of every FMU and SSP file of this package below `folder`, and a page that lists them.

    `tell` is called with the part of the work that is done, 0 to 1. Returns that page. Raises OSError: it cannot be
    written; NotCompiledError: there is no machine code.
    """
    folder, rows = Path(folder), []
    for done, (kind, product) in enumerate(PRODUCTS.items(), 1):
        pages = _write_pages(product, folder / kind)
        first = "index.html" if "index.html" in pages else next(name for name in pages if name.endswith(".html"))
        rows.append(f'<li><a href="{kind}/{first}">{product.name}</a>: {escape(product.purpose)}.</li>')
        tell(done / len(PRODUCTS))
    style = (FOLDER / "style.css").read_text(encoding="utf-8")
    head = f'<meta charset="utf-8">\n<title>{TITLE}</title>\n<style>\n{style}</style>'
    body = "\n".join([f"<h1>{TITLE}</h1>", "<ul>", *rows, "</ul>"])
    page = f'<!DOCTYPE html>\n<html lang="en">\n<head>\n{head}\n</head>\n<body>\n{body}\n</body>\n</html>\n'
    write_whole(folder / "index.html", page.encode())
    return folder / "index.html"


def _write_pages(product: Product, folder: Path) -> list[str]:
    """Those that are inside a file, and their names."""
    with temporary_folder() as place, zipfile.ZipFile(product.write(Path(place) / product.name)) as archive:
        pages = [name for name in archive.namelist() if name.startswith(PAGES)]
        for name in pages:
            write_whole(folder / name.removeprefix(PAGES), archive.read(name))
    return [name.removeprefix(PAGES) for name in pages]
