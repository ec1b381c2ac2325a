# SPDX-License-Identifier: GPL-3.0-or-later
"""The plans that a sentence leaves open as an SVG picture that needs nothing else to be read.

Layers go from left to right: joint states in boxes with a band in the colour of their word, and
between them the joint actions.  Every edge's text is an item of a column of its own, so that no
text lies on another one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape

from coordlang.use.sentence.drawing import (
    Ink,
    cut_note,
    edge_lines,
    headline,
    inks,
    node_lines,
    plans_text,
)
from coordlang.use.sentence.plan_dag import DagNode, PlanDag

# Pixels.  Text is monospaced, so that its width is known.
_FONT = 11
_CHAR = 6.7
_LINE = 14
_BAND = 18
_PAD = 8
_BEND = 46
_GAP = 14
_MARGIN = 20
_HEAD = 104
_SWEEPS = 12


@dataclass(slots=True)
class _Item:
    """A box of a column: a node or the text of an edge.

    ``before`` and ``after`` are its neighbours' numbers.
    """

    width: float
    height: float
    y: float = 0.0
    before: list[int] = field(default_factory=list)
    after: list[int] = field(default_factory=list)

    @property
    def middle(self) -> float:
        """The height of its middle on the page."""
        return self.y + self.height / 2


def to_svg(dag: PlanDag) -> str:
    """A self-contained SVG picture.  The same DAG gives the same bytes."""
    ink, lines = inks(dag), node_lines(dag)
    texts = [edge_lines(dag, edge) for edge in dag.edges]
    items, columns = _items(dag, lines, texts)
    _place(items, columns)
    lefts, right = _lefts(items, columns)
    centre = {
        n: left + _widest(items, column) / 2
        for column, left in zip(columns, lefts, strict=True)
        for n in column
    }
    note = cut_note(dag)
    title = [headline(dag), dag.task, *([note] if note else [])]
    title_end = 2 * _MARGIN + _CHAR * 1.2 * max(map(len, title))
    width = max(right + _MARGIN, title_end, _chips_end(dag))
    height = max(item.y + item.height for item in items) + _MARGIN
    body = [*_heading(dag, ink, title), *_column_heads(columns, lefts, items)]
    for number, edge in enumerate(dag.edges, len(dag.nodes)):
        dashed = bool(dag.nodes[edge.source].merged or dag.nodes[edge.target].merged)
        own = texts[number - len(dag.nodes)]
        body += _edge(items, centre, edge.source, number, edge.target, own, dashed)
    for number, node in enumerate(dag.nodes):
        body += _node(items[number], centre[number], node, lines[number], ink)
    return "\n".join([*_open(width, height, title[0], dag.task), *body, "</svg>"]) + "\n"


def _lefts(items: Sequence[_Item], columns: Sequence[Sequence[int]]) -> tuple[list[float], float]:
    """The left side of each column, and the right side of the last one."""
    lefts, x = [], float(_MARGIN)
    for number, column in enumerate(columns):
        bend = _BEND if number % 2 else 0
        lefts.append(x + bend)
        x += _widest(items, column) + 2 * bend
    return lefts, x


def _widest(items: Sequence[_Item], column: Sequence[int]) -> float:
    return max((items[n].width for n in column), default=0.0)


def _items(
    dag: PlanDag, lines: Sequence[list[str]], texts: Sequence[list[str]]
) -> tuple[list[_Item], list[list[int]]]:
    """The boxes, nodes first, and the columns from left to right: nodes, texts, nodes, .."""
    items = [
        _Item(
            _CHAR * max(len(s) for s in [*own, f"{node.word}  {plans_text(node.plans)}"])
            + 2 * _PAD,
            _BAND + _LINE * len(own) + (_PAD if own else 0),
        )
        for node, own in zip(dag.nodes, lines, strict=True)
    ]
    columns: list[list[int]] = []
    for layer in dag.layers:
        columns += [list(layer), []]
    columns.pop()
    for edge, own in zip(dag.edges, texts, strict=True):
        number = len(items)
        items.append(_Item(_CHAR * max(map(len, own), default=0) + _PAD, _LINE * len(own)))
        items[number].before, items[number].after = [edge.source], [edge.target]
        items[edge.source].after.append(number)
        items[edge.target].before.append(number)
        columns[2 * dag.nodes[edge.source].step + 1].append(number)
    return items, columns


def _place(items: list[_Item], columns: list[list[int]]) -> None:
    """Order every column so that few edges cross, and give every box its height on the page."""
    for column in columns:
        _stack(items, column, [0.0] * len(column))
    for sweep in range(_SWEEPS):
        forward = sweep % 2 == 0
        for column in columns[1:] if forward else columns[-2::-1]:
            wanted = {n: _wanted(items, n, forward) for n in column}
            column.sort(key=lambda n: (wanted[n], n))
            _stack(items, column, [wanted[n] - items[n].height / 2 for n in column])
    top = min(item.y for item in items)
    for item in items:
        item.y += _HEAD + _MARGIN - top


def _wanted(items: Sequence[_Item], number: int, forward: bool) -> float:
    """The mean height of a box's neighbours on one side; where it is, if it has none there."""
    neighbours = items[number].before if forward else items[number].after
    if not neighbours:
        return items[number].middle
    return sum(items[n].middle for n in neighbours) / len(neighbours)


def _stack(items: list[_Item], column: Sequence[int], wanted: Sequence[float]) -> None:
    """Put a column's boxes below each other, as near as can be to where they are wanted.

    By least squares.

    With the heights above subtracted this is isotonic regression: pools of boxes that touch move
    together.
    """
    offsets, pools = 0.0, []
    for n, y in zip(column, wanted, strict=True):
        pools.append([y - offsets, 1])
        offsets += items[n].height + _GAP
        while len(pools) > 1 and pools[-2][0] > pools[-1][0]:
            mean, size = pools.pop()
            pools[-1] = [
                (pools[-1][0] * pools[-1][1] + mean * size) / (pools[-1][1] + size),
                pools[-1][1] + size,
            ]
    places = [mean for mean, size in pools for _ in range(int(size))]
    offsets = 0.0
    for n, place in zip(column, places, strict=True):
        items[n].y = place + offsets
        offsets += items[n].height + _GAP


def _open(width: float, height: float, title: str, task: str) -> list[str]:
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" width="{width:.0f}" '
        f'height="{height:.0f}" '
        f'viewBox="0 0 {width:.0f} {height:.0f}" font-family="ui-monospace, Menlo, Consolas, '
        "'DejaVu Sans Mono', "
        f'monospace" font-size="{_FONT}">',
        f"<title>{escape(title)}</title>",
        f"<desc>{escape(task)}</desc>",
        '<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" '
        'markerHeight="7" orient="auto">'
        '<path d="M0,0.5 L8,4 L0,7.5 z" fill="#555"/></marker></defs>',
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
    ]


def _heading(dag: PlanDag, ink: dict[str, Ink], title: Sequence[str]) -> list[str]:
    """The title, the task, the note about a cut, and the sentence as coloured words."""
    out = [
        _text(_MARGIN, 28, title[0], size=14, weight="bold"),
        _text(_MARGIN, 46, dag.task, colour="#555"),
    ]
    x = float(_MARGIN)
    for word in _chips(dag):
        width = _CHAR * len(word) + 2 * _PAD
        out.append(
            f'<rect x="{x:.1f}" y="56" width="{width:.1f}" height="{_BAND}" rx="4" '
            f'fill="{ink[word].fill}"/>'
        )
        out.append(_text(x + _PAD, 69, word, colour=ink[word].text, weight="bold"))
        x += width + 6
    if len(title) > 2:
        out.append(_text(_MARGIN, 90, title[2], colour="#a00000"))
    return out


def _chips_end(dag: PlanDag) -> float:
    return 2 * _MARGIN + sum(_CHAR * len(word) + 2 * _PAD + 6 for word in _chips(dag))


def _chips(dag: PlanDag) -> tuple[str, ...]:
    """The words below the title: the sentence, or else all words as a legend."""
    return dag.sentence or dag.words


def _column_heads(
    columns: Sequence[Sequence[int]], lefts: Sequence[float], items: Sequence[_Item]
) -> list[str]:
    out = []
    for k, (column, left) in enumerate(zip(columns, lefts, strict=True)):
        centre = left + _widest(items, column) / 2
        name = _column_name(k, len(columns))
        out.append(_text(centre, _HEAD + 10, name, colour="#777", anchor="middle"))
    return out


def _column_name(column: int, columns: int) -> str:
    """What stands over a column: the number of the step over its texts."""
    if column % 2:
        return f"step {column // 2 + 1}"
    if column == 0:
        return "start"
    return "end" if column == columns - 1 else ""


def _node(
    item: _Item, centre: float, node: DagNode, lines: Sequence[str], ink: dict[str, Ink]
) -> list[str]:
    left = centre - item.width / 2
    plans = plans_text(node.plans)
    box = (
        f'x="{left:.1f}" y="{item.y:.1f}" width="{item.width:.1f}" height="{item.height:.1f}" '
        'rx="4"'
    )
    own = ink.get(node.word)
    out = [f"<g><title>{escape(node.key or lines[0])}</title>"]
    if own is None:  # several nodes as one
        out.append(f'<rect {box} fill="#ffffff" stroke="#777" stroke-dasharray="5 3"/>')
        out.append(_text(left + _PAD, item.y + 13, plans, colour="#555"))
    else:
        dashes = ' stroke-dasharray="2 2"' if own.again else ""
        out.append(f'<rect {box} fill="{own.fill}"/>')
        out.append(_text(left + _PAD, item.y + 13, node.word, colour=own.text, weight="bold"))
        out.append(
            _text(left + item.width - _PAD, item.y + 13, plans, colour=own.text, anchor="end")
        )
        y, h = item.y + _BAND, item.height - _BAND
        out.append(
            f'<path d="M{left:.1f},{y:.1f} h{item.width:.1f} v{h:.1f} h-{item.width:.1f} z" '
            'fill="#ffffff"/>'
        )
        out.append(f'<rect {box} fill="none" stroke="{own.fill}" stroke-width="1.5"{dashes}/>')
    out += [
        _text(left + _PAD, item.y + _BAND + _LINE * (k + 1) - 2, line)
        for k, line in enumerate(lines)
    ]
    return [*out, "</g>"]


def _edge(
    items: Sequence[_Item],
    centre: dict[int, float],
    source: int,
    text: int,
    target: int,
    lines: Sequence[str],
    dashed: bool,
) -> list[str]:
    """A curve to the text, the text, and a curve on to the target."""
    a, b, c = items[source], items[text], items[target]
    x1, y1 = centre[source] + a.width / 2, a.y + a.height / 2
    x2, x3, y2 = centre[text] - b.width / 2, centre[text] + b.width / 2, b.y + b.height / 2
    x4, y4 = centre[target] - c.width / 2, c.y + c.height / 2
    look = ' stroke-dasharray="4 3"' if dashed else ""
    line = 'fill="none" stroke="#555"'
    out = []
    if lines:
        out.append(f'<path d="{_curve(x1, y1, x2 - 2, y2)}" {line}{look}/>')
        out.append(
            f'<path d="{_curve(x3 + 2, y2, x4 - 1, y4)}" {line}{look} marker-end="url(#head)"/>'
        )
        out += [_text(x2 + _PAD / 2, b.y + _LINE * (k + 1) - 3, own) for k, own in enumerate(lines)]
    else:
        path = f"{_curve(x1, y1, x2, y2)} {_curve(x3, y2, x4 - 1, y4).replace('M', 'L')}"
        out.append(f'<path d="{path}" {line}{look} marker-end="url(#head)"/>')
    return out


def _curve(x1: float, y1: float, x2: float, y2: float) -> str:
    middle = (x1 + x2) / 2
    return f"M{x1:.1f},{y1:.1f} C{middle:.1f},{y1:.1f} {middle:.1f},{y2:.1f} {x2:.1f},{y2:.1f}"


def _text(
    x: float,
    y: float,
    text: str,
    *,
    colour: str = "#000",
    size: int = _FONT,
    weight: str = "",
    anchor: str = "",
) -> str:
    extra = f' font-size="{size}"' * (size != _FONT) + f' font-weight="{weight}"' * bool(weight)
    extra += f' text-anchor="{anchor}"' * bool(anchor)
    return f'<text x="{x:.1f}" y="{y:.1f}" fill="{colour}"{extra}>{escape(text)}</text>'
