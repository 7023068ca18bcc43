"""`draw` and `save`: a `Picture` as a matplotlib figure and as a file; the one home of matplotlib.

Figures are made without pyplot: no window, no global state, no backend to choose.
"""

from __future__ import annotations

import contextlib
import io
import math
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from mbsim.errors import ModelError
from mbsim.results.curves import Curve, Panel, Picture, components
from mbsim.results.products import check_product, write_product
from mbsim.results.quantities import quantity_of
from mbsim.results.units import INCIDENTS, TIME, UnitSystem

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    from mbsim.results.reading import Results

SUFFIXES = (".png", ".svg")

# colours that colour-blind readers tell apart (Okabe and Ito, Color Universal Design, 2008),
# in an order in which neighbours differ in lightness, for print in grey
_COLOURS = ("#0072B2", "#E69F00", "#000000", "#CC79A7", "#009E73", "#56B4E9", "#D55E00")
_DASHES: tuple[Any, ...] = ("-", (0, (5, 1.8)), (0, (6, 1.5, 1.2, 1.5)), (0, (1.2, 1.2)))
_GREY, _RED = "0.35", "#A00000"
_EVENT_DASHES: dict[str, Any] = {"touch": "-", "leave": (0, (4, 3)), "stick": (0, (1, 2))}

_WIDTH = 7.5  # [inch]
_FONT = 10.0  # [pt]
_LINE = 0.19  # height of a line of text [inch]
#: What legends have beside tick labels [pt]; a sample and its gaps take _SAMPLE [em].
_LEGEND, _SAMPLE = 470.0, 5.2
#: Most entries of a legend; more would be a page of their own.
_ENTRIES = 24

_STYLE: dict[str, Any] = {
    "font.size": _FONT,
    "axes.titlesize": _FONT,
    "legend.fontsize": _FONT - 1.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "0.88",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "axes.xmargin": 0.0,
    "axes.formatter.useoffset": False,
    "axes.formatter.use_mathtext": True,
    "axes.formatter.limits": (-3, 5),
    "agg.path.chunksize": 10000,  # a path of a million points is drawn in pieces
    "svg.fonttype": "none",  # text stays text
    "svg.hashsalt": "mbsim",  # the same picture is the same file
    "savefig.dpi": 160,
}


@contextlib.contextmanager
def _style() -> Iterator[None]:
    """Draw alike everywhere, whatever the user's own matplotlib settings are."""
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(cast(Any, _STYLE))
        yield


def need_matplotlib(what: str = "plot") -> None:
    """Raise `ModelError`, which names what needs it, unless matplotlib is there."""
    try:
        import matplotlib  # noqa: F401
    except ImportError:
        raise ModelError(
            f"{what} needs matplotlib, which is not installed: pip install matplotlib"
        ) from None


def draw(picture: Picture) -> Figure:
    """Return a figure: panels above each other, title on top, sources at the bottom.

    Every curve is a line whose data are the curve's own numbers.
    """
    need_matplotlib()
    with _style():
        from matplotlib.figure import Figure

        rows = [_legend_rows(picture, panel) for panel in picture.panels]
        foot = [line for note in picture.notes for line in textwrap.wrap(note, 115)]
        heading = [*textwrap.wrap(picture.title, 75)]
        shouted = [line for text in picture.warnings for line in textwrap.wrap(text, 90)]
        heights = _panel_heights(len(picture.panels), rows)
        lines = len(foot) + len(heading) + len(shouted)
        figure = Figure(figsize=(_WIDTH, sum(heights) + 0.6 + _LINE * lines), layout="constrained")
        grid = figure.subplots(
            len(picture.panels),
            1,
            sharex=not any(panel.over for panel in picture.panels),
            squeeze=False,
            height_ratios=heights,
        )
        axes: list[Axes] = list(grid[:, 0])
        for axis, panel in zip(axes, picture.panels, strict=True):
            _fill(axis, picture, panel)
            if panel.over:
                axis.set_xlabel(_plain(panel.over))
                axis.margins(x=0.03)
        if picture.axis:
            axes[-1].set_xlabel(_plain(picture.axis))
        figure.align_ylabels(axes)
        if picture.span is not None and picture.span[1] > picture.span[0]:
            axes[-1].set_xlim(*picture.span)
        elif picture.span is None:
            axes[-1].margins(x=0.03)
        _write_around(figure, heading, shouted, foot)
    return figure


def draw_signals(results: Results, names: Sequence[str], ax: Axes | None = None) -> Axes:
    """Draw signals over time on axes in the user's own style, new ones of pyplot if not given."""
    need_matplotlib("results.plot")
    from matplotlib import pyplot

    if not names:
        raise ModelError("results.plot needs the name of a signal; results.signals() has all")
    system = UnitSystem.of(results.attributes)
    wanted = [each for name in names for each in components(results, name)]
    axes = pyplot.subplots()[1] if ax is None else ax
    quantities = [quantity_of(results, each.dataset, each.column) for each in wanted]
    alike = len(set(quantities)) == 1
    for each, quantity in zip(wanted, quantities, strict=True):
        unit = system.text(quantity)
        label = each.name if alike or not unit else f"{each.name} [{unit}]"
        axes.plot(results["time"], results[each.name], label=_plain(label))
    axes.set_xlabel(f"Time [{system.text(TIME)}]")
    unit = system.text(quantities[0]) if alike else ""
    if alike:
        axes.set_ylabel(_plain(f"{quantities[0].name} [{unit}]" if unit else quantities[0].name))
    axes.legend()
    return axes


def figure_of_points(panels: Sequence[Sequence[Any]], title: str) -> Figure:
    """Return a figure of points: rows of panels, each x name, y name, x, y, and which are marked.

    Marked points are red crosses.
    """
    need_matplotlib()
    with _style():
        from matplotlib.figure import Figure

        rows, columns = len(panels), max(map(len, panels))
        size = (max(_WIDTH, 2.2 * columns), 2.0 * rows + 0.6)
        figure = Figure(figsize=size, layout="constrained")
        grid = figure.subplots(rows, columns, sharex="col", sharey="row", squeeze=False)
        for axes, row in zip(grid, panels, strict=True):
            for k, (name, output, x, y, marked) in enumerate(row):
                axes[k].plot(x[~marked], y[~marked], ".", color=_COLOURS[0], markersize=3.0)
                axes[k].plot(x[marked], y[marked], "x", color=_RED, markersize=4.0)
                axes[k].margins(x=0.05)
                if k == 0:
                    axes[k].set_ylabel(_plain(output))
                if row is panels[-1]:
                    axes[k].set_xlabel(_plain(name))
        figure.suptitle(_plain(title), fontsize=_FONT + 2, fontweight="bold")
    return figure


def _write_around(
    figure: Figure, heading: Sequence[str], shouted: Sequence[str], foot: Sequence[str]
) -> None:
    """Write title, warnings and notes; the layout leaves room for them."""
    title = "\n".join(map(_plain, heading))
    if not shouted:
        figure.suptitle(title, fontsize=_FONT + 2, fontweight="bold")
    else:
        # one text only is made room for: the name stands above the warning in it
        figure.suptitle(
            title + "\n" + "\n".join(map(_plain, shouted)),
            fontsize=_FONT + 1,
            fontweight="bold",
            color=_RED,
        )
    figure.supxlabel(
        "\n".join(map(_plain, foot)),
        fontsize=_FONT - 3,
        color=_GREY,
        x=0.01,
        horizontalalignment="left",
        multialignment="left",
    )


def _panel_heights(count: int, legend_rows: Sequence[int]) -> list[float]:
    """Return heights of the panels [inch]; one alone is larger."""
    height = {1: 3.4, 2: 2.4}.get(count, 2.0)
    return [height + _LINE * rows for rows in legend_rows]


def _fill(axis: Axes, picture: Picture, panel: Panel) -> None:
    """Draw one panel."""
    from matplotlib.ticker import MaxNLocator

    lines = [_line(axis, picture, panel, curve) for curve in panel.curves]
    if picture.log:
        axis.set_yscale("log")
        _number_decades(axis)
    else:
        _widen(axis, panel)
        if panel.quantity == INCIDENTS:
            axis.yaxis.set_major_locator(MaxNLocator(integer=True))
        # above the ticks, where the legend does not reach
        axis.yaxis.get_offset_text().set_horizontalalignment("right")
    axis.set_ylabel(_plain(panel.axis))
    lines += _marks(axis, picture, panel)
    _legend(axis, picture, panel, lines)


def _line(axis: Axes, picture: Picture, panel: Panel, curve: Curve) -> Line2D:
    """Draw one curve; points without neighbours, which no line shows, are marked."""
    colour, dashes = _look(picture, panel, curve)
    # a wide pale first run stays in sight under others that agree with it
    under = len(picture.files) > 1 and curve.file == 0
    alone = _isolated(curve)
    (line,) = axis.plot(
        curve.x,
        curve.y,
        color=colour,
        linestyle=dashes,
        linewidth=3.5 if under else 1.5,
        alpha=0.45 if under else 1.0,
        marker="o" if alone else "",
        markevery=alone,
        markersize=4,
    )
    line.set_gid(_plain(curve.name))
    if curve.band is not None:
        finite = np.where(np.isfinite(curve.band), curve.band, np.nan)
        low, high = curve.y - finite, curve.y + finite
        axis.fill_between(curve.x, low, high, color=colour, alpha=0.2, linewidth=0.0)
    return line


def _isolated(curve: Curve) -> list[int]:
    """Return which points have a gap, or nothing, on both sides."""
    there = np.isfinite(np.concatenate([[np.nan], curve.x + curve.y, [np.nan]]))
    alone: list[int] = np.flatnonzero(there[1:-1] & ~there[:-2] & ~there[2:]).tolist()
    return alone


def _look(picture: Picture, panel: Panel, curve: Curve) -> tuple[str, Any]:
    """Return colour and dashes of a curve.

    In one file each signal has both of its own. In several files the colour says which
    signal it is, the dashes which file; of one signal only, both say which file.
    """
    names = list(dict.fromkeys(other.name for other in panel.curves))
    signal = names.index(curve.name)
    if len(picture.files) == 1:
        colour, style = signal, signal
    elif len(names) == 1:
        colour, style = curve.file, curve.file
    else:
        colour = signal + len(names) * (curve.file // len(_DASHES))
        style = curve.file
    return _COLOURS[colour % len(_COLOURS)], _DASHES[style % len(_DASHES)]


def _widen(axis: Axes, panel: Panel) -> None:
    """Show a signal that only rounding errors move as the straight line that it is."""
    values = [curve.y[np.isfinite(curve.y)] for curve in panel.curves]
    finite = np.concatenate(values) if values else np.zeros(0)
    if not len(finite):
        return
    low, high = float(finite.min()), float(finite.max())
    size = max(abs(low), abs(high))
    if high - low < 1e-9 * size:
        middle = 0.5 * (low + high)
        axis.set_ylim(middle - 0.05 * size, middle + 0.05 * size)


def _number_decades(axis: Axes) -> None:
    """Write plain numbers on a log axis of less than two decades, and give it a finer grid."""
    from matplotlib.ticker import LogFormatter

    class Plain(LogFormatter):
        """Numbers as %g where matplotlib would write powers, and none where it writes none."""

        def __call__(self, x: float, pos: int | None = None) -> str:
            return f"{x:.6g}" if super().__call__(x, pos) else ""

    low, high = axis.get_ylim()
    if high < 100.0 * low:
        axis.yaxis.set_major_formatter(Plain())
        axis.yaxis.set_minor_formatter(Plain(minor_thresholds=(2.0, 0.5)))
        axis.grid(which="minor", axis="y", linewidth=0.4)


def _marks(axis: Axes, picture: Picture, panel: Panel) -> list[Line2D]:
    """Draw events, and until when derivatives are known, as lines across the panel.

    Returns
    -------
    list of Line2D
        Samples for the legend.
    """
    from matplotlib.lines import Line2D

    def across(times: Any, colour: str, dashes: Any, width: float) -> Line2D:
        axis.vlines(
            times,
            0.0,
            1.0,
            transform=axis.get_xaxis_transform(),
            colors=colour,
            linestyles=dashes,
            linewidths=width,
            zorder=0.9,
        )
        return Line2D([], [], color=colour, linestyle=dashes, linewidth=width + 0.2)

    samples = []
    for k, until in enumerate(panel.until.values()):
        samples.append(across(until, _RED, _DASHES[(k + 1) % len(_DASHES)], 0.9))
    for kind, times in picture.events.items():
        samples.append(across(times, "0.6", _EVENT_DASHES.get(kind, (0, (6, 2, 1, 2))), 0.7))
    return samples


def _entries(picture: Picture, panel: Panel) -> list[str]:
    """Return the texts of a panel's legend: curves, marks; in the first also kinds of events."""
    several = len(picture.files) > 1
    texts = [
        f"{picture.files[curve.file]}: {curve.label}" if several else curve.label
        for curve in panel.curves
    ]
    texts += panel.until
    if panel is not picture.panels[0]:
        return texts
    return texts + [f"{kind} ({len(times)})" for kind, times in picture.events.items()]


def _columns(texts: Sequence[str]) -> int:
    """Return how many entries fit beside each other."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextToPath

    size = _STYLE["legend.fontsize"]
    font, measure = FontProperties(size=size), TextToPath()
    widths = [measure.get_text_width_height_descent(text, font, ismath=False)[0] for text in texts]
    most = max(1, int(_LEGEND / (max(widths) + _SAMPLE * size)))
    # no more columns than the rows need, so that they are filled evenly
    return math.ceil(len(texts) / math.ceil(len(texts) / most))


def _legend_rows(picture: Picture, panel: Panel) -> int:
    texts = _entries(picture, panel)
    shown = texts[:_ENTRIES]
    return math.ceil(len(shown) / _columns(shown)) + (len(texts) > _ENTRIES)


def _legend(axis: Axes, picture: Picture, panel: Panel, lines: Sequence[Line2D]) -> None:
    """Write the legend above the axes, where it hides nothing."""
    texts = _entries(picture, panel)
    shown = texts[:_ENTRIES]
    more = len(texts) - len(shown)
    axis.legend(
        lines[: len(shown)],
        # matplotlib leaves out what begins with "_"
        [" " + _plain(text) if text.startswith("_") else _plain(text) for text in shown],
        loc="lower left",
        bbox_to_anchor=(0.01, 1.0),
        borderaxespad=0.2,
        borderpad=0.1,
        ncols=_columns(shown),
        frameon=False,
        handlelength=2.8,
        columnspacing=1.6,
        labelspacing=0.3,
        title_fontsize=_STYLE["legend.fontsize"],
        title=f"the first {len(shown)} of {len(texts)} curves" if more else None,
        alignment="left",
    )


def _plain(text: str) -> str:
    """Return a text that is drawn letter by letter: a ``$`` in a label begins no formula.

    Bytes of a name that are no text, which no font has, are shown by their numbers.
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8").replace("$", r"\$")


def save(figure: Figure, path: Path) -> list[str]:
    """Write a figure as PNG or SVG, by the suffix; return what should be said of it.

    A file in the way is replaced as a whole if it is a picture, else left alone.

    Raises
    ------
    ModelError
        If the suffix is another one, or something that is no picture is in the way.
    ResultsError
        If the file cannot be written.
    """
    check_target(path)
    made = io.BytesIO()
    # a date would make two equal pictures differ
    facts: dict[str, Any] = {"Date": None} if path.suffix.lower() == ".svg" else {}
    with _style(), warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        figure.savefig(made, format=path.suffix.lower()[1:], metadata=facts)
    write_product(path, made.getvalue(), "picture")
    said = [str(warning.message) for warning in caught]
    if any("Glyph" in text for text in said):
        return ["the font of the picture lacks letters of some labels"]
    return list(dict.fromkeys(said))


def check_target(path: Path) -> None:
    """Raise `ModelError` unless a picture may be written there."""
    if path.suffix.lower() not in SUFFIXES:
        raise ModelError(f"-o {path}: the name must end in {' or '.join(SUFFIXES)}")
    check_product(path, "picture")
