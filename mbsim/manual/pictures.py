"""Pictures of the manual: functions in `drawings/` that each draw one file of `pages/pictures/`."""

from __future__ import annotations

import importlib
import pkgutil
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from mbsim.manual.book import PAGES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

FOLDER = PAGES / "pictures"
#: Largest picture [bytes].
LARGEST = 60_000
_STYLE: dict[str, Any] = {
    "font.size": 10.0,
    "axes.titlesize": 10.0,
    "legend.fontsize": 9.0,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.88",
    "axes.axisbelow": True,
    "svg.hashsalt": "mbsim",  # the same picture, the same file
    "svg.fonttype": "path",
    "path.simplify_threshold": 0.5,
}

Drawing = Callable[["Figure"], None]
_DRAWINGS: dict[str, tuple[Drawing, tuple[float, float]]] = {}


def picture(name: str, width: float = 7.0, height: float = 3.6) -> Callable[[Drawing], Drawing]:
    """Register the decorated function, which draws on a figure of this size [inch], as `name`."""

    def register(draw: Drawing) -> Drawing:
        if name in _DRAWINGS:
            raise ValueError(f"{name} is drawn twice")
        _DRAWINGS[name] = (draw, (width, height))
        return draw

    return register


def drawings() -> dict[str, tuple[Drawing, tuple[float, float]]]:
    """Return all drawings by file name, read from `drawings/`."""
    package = importlib.import_module("mbsim.manual.drawings")
    for module in pkgutil.iter_modules(package.__path__):
        importlib.import_module(f"{package.__name__}.{module.name}")
    return _DRAWINGS


def draw(name: str, folder: Path = FOLDER) -> Path:
    """Make one picture; return its file."""
    import matplotlib
    from matplotlib.figure import Figure

    function, size = drawings()[name]
    path = folder / name
    with matplotlib.rc_context(cast("Any", _STYLE)):
        figure = Figure(figsize=size, layout="constrained")
        function(figure)
        figure.savefig(path, format="svg", facecolor="white", metadata={"Date": None})
    path.write_text(_smaller(path.read_text(encoding="utf-8")), encoding="utf-8")
    return path


def _smaller(svg: str) -> str:
    """Return an SVG file without what nobody sees: header, digits, letters' shapes again."""
    head = r"<\?xml[^>]*>\s*|<!DOCTYPE[^>]*>\s*|<metadata>.*?</metadata>\s*|<!--.*?-->\s*"
    svg = re.sub(head, "", svg, flags=re.DOTALL)
    svg = re.sub(r"\s*\n\s*", "\n", svg)
    names: dict[str, str] = {}

    def once(match: re.Match[str]) -> str:
        """Return the shape of a letter where it comes first, under a short name."""
        name = match.group(1)
        if name in names:
            return ""
        names[name] = f"c{len(names)}"
        return match.group().replace(name, names[name])

    svg = re.sub(r'<path id="(\w+-(?:\w+-)?\w+)"[^>]*/>\n', once, svg)
    svg = re.sub(r'#([\w-]+)"', lambda match: f'#{names.get(match.group(1), match.group(1))}"', svg)
    svg = re.sub(r"<defs>\s*</defs>\n?", "", svg)
    svg = re.sub(r"([1-9]\d*\.\d\d)\d+", r"\1", svg)
    return re.sub(r"(\b0\.\d{6})\d+", r"\1", svg)
