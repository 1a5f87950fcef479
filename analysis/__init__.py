"""Figures, tables, videos and reports made from run folders, without importing any run's code.

    from evoros.analysis import analyze, load_study, save

    study = load_study(["outputs/study"])
    product = analyze(study, "compare", under="spatial")
    save(product.figure, "compare.pdf", "pdf")
    product.table  # a pandas frame

All names are imported on first use.
"""

from typing import TYPE_CHECKING

from evoros.files.private import keep_fonts

if __name__ != "evoros.analysis":
    raise ImportError(
        f"{__name__}: this is a part of evoros; import it as evoros.analysis, or, to import your "
        f"own package {__name__}, give it an __init__.py and put it first on sys.path"
    )

keep_fonts()

if TYPE_CHECKING:
    from .drawing.style import save
    from .products import analyze
    from .subcommands import Product
    from .tables.loading import load_study
    from .tables.study import Study

# docs/generate expects one name per line
__all__ = [
    "Product",
    "Study",
    "analyze",
    "load_study",
    "save",
]

if not TYPE_CHECKING:  # otherwise, type checkers would accept any name
    from evoros.base.lazy import import_lazily

    _HOMES = {
        "Product": "subcommands",
        "Study": "tables.study",
        "analyze": "products",
        "load_study": "tables.loading",
        "save": "drawing.style",
    }
    __getattr__, __dir__ = import_lazily(__name__, _HOMES)
