r"""Formulas: LaTeX as the pages have it, to MathML and to text for a terminal.

A ``math`` block holds one formula a line; an environment (``\begin`` to ``\end``) is one formula.
"""

from __future__ import annotations

import re

_GREEK = dict(
    zip(
        (
            "alpha beta gamma delta epsilon varepsilon zeta eta theta vartheta iota kappa lambda "
            "mu nu xi pi rho sigma tau upsilon phi varphi chi psi omega "
            "Gamma Delta Theta Lambda Xi Pi Sigma Upsilon Phi Psi Omega"
        ).split(),
        "αβγδϵεζηθϑικλμνξπρστυϕφχψωΓΔΘΛΞΠΣΥΦΨΩ",
        strict=True,
    )
)
_SIGNS = dict(
    pair.split(":")
    for pair in (
        "cdot:· times:\u00d7 le:≤ leq:≤ ge:≥ geq:≥ ne:≠ neq:≠ approx:≈ sim:~ pm:± mp:∓ infty:∞ "
        "sum:Σ prod:Π int:∫ partial:∂ nabla:∇ in:∈ to:→ rightarrow:→ leftarrow:← Rightarrow:⇒ "
        "iff:⇔ equiv:≡ ldots:... dots:... cdots:··· circ:° perp:⊥ parallel:∥ ll:≪ gg:≫ forall:∀ "
        "propto:∝ top:ᵀ prime:' langle:⟨ rangle:⟩ mid:| lVert:| rVert:| Vert:| lvert:| rvert:| "
        "vert:| ell:\u2113 otimes:⊗ left: right: bigl: bigr: Bigl: Bigr: big: Big: "
        "displaystyle: limits:"
    ).split()
) | {"quad": "   ", "qquad": "   "}
_ACCENTS = {
    **{"dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "bar": "\u0304", "tilde": "\u0303"},
    **{"vec": "\u20d7", "overline": "\u0304"},
}
_PLAIN = ("text", "mathrm", "mathbf", "mathit", "boldsymbol", "operatorname", "mathsf", "bm")
_UP = dict(zip("0123456789+-=()nijkTxyz", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁼⁽⁾ⁿⁱʲᵏᵀˣʸᶻ", strict=True))
_DOWN = dict(
    zip("0123456789+-=()aehijklmnoprstuvx", "₀₁₂₃₄₅₆₇₈₉₊₋₌₍₎ₐₑₕᵢⱼₖₗₘₙₒₚᵣₛₜᵤᵥₓ", strict=True)
)
#: One symbol with a prime, as latex2mathml writes it.
_PRIME = re.compile(r"<msup>(<mi>[^<]*</mi>)<mi>&#x02032;</mi></msup>")
_ENVIRONMENT = re.compile(r"\\begin\{(\w+\*?)\}")


def formulas(block: str) -> list[str]:
    """Return the formulas of a block: one a line, an environment as a whole."""
    found: list[str] = []
    inside = ""
    for line in block.splitlines():
        if inside:
            found[-1] += " " + line.strip()
            if f"\\end{{{inside}}}" in line:
                inside = ""
            continue
        if not line.strip():
            continue
        found.append(line.strip())
        match = _ENVIRONMENT.search(line)
        if match and f"\\end{{{match.group(1)}}}" not in line:
            inside = match.group(1)
    return [re.sub(r"\\\\$", "", formula) for formula in found]


def to_mathml(block: str) -> str:
    """Return the formulas of a block as MathML, one display each."""
    from latex2mathml.converter import convert

    found = "\n".join(convert(formula, display="block") for formula in formulas(block))
    # a prime is raised by its own shape; as an index it would be lost above the line
    return _PRIME.sub(r"<mrow>\1<mo>&#x02032;</mo></mrow>", found)


def to_text(block: str) -> str:
    """Return the formulas of a block as Unicode text, one a line."""
    return "\n".join(_Text(formula).read() for formula in formulas(block))


class _Text:
    """One formula, read from left to right."""

    def __init__(self, latex: str) -> None:
        latex = latex.replace(r"\,", " ").replace(r"\;", " ").replace(r"\!", "")
        latex = latex.replace(r"\:", " ").replace(r"\ ", " ")
        self._tokens = re.findall(r"\\[A-Za-z]+|\\.|\s+|.", latex)
        self._at = 0

    def read(self) -> str:
        """Return the whole formula."""
        found = ""
        while self._at < len(self._tokens):
            found += self._next()
        found = re.sub(r" {4,}", "   ", found)
        return re.sub(r"(?<! )  (?! )", " ", found).strip()

    def _group(self) -> str:
        """Return the next argument: a group in braces, or one token."""
        while self._at < len(self._tokens) and self._tokens[self._at].isspace():
            self._at += 1
        if self._at >= len(self._tokens):
            return ""
        if self._tokens[self._at] != "{":
            return self._next()
        self._at += 1
        found = ""
        while self._at < len(self._tokens) and self._tokens[self._at] != "}":
            found += self._next()
        self._at += 1
        return found

    def _next(self) -> str:
        """Return the text of the next token and what belongs to it."""
        token: str = self._tokens[self._at]
        if token == "{":
            return self._group()
        self._at += 1
        if token.isspace():
            return " "
        if token in "^_":
            return _raised(self._group(), token)
        if token in ("&", "}"):
            return ""
        if not token.startswith("\\"):
            return token
        return self._command(token[1:])

    def _command(self, name: str) -> str:
        """Return the text of a command."""
        if name in ("frac", "dfrac", "tfrac"):
            above, below = self._group(), self._group()
            return f"{_closed(above)}/{_closed(below)}"
        if name == "sqrt":
            return "√" + _closed(self._group())
        if name in _ACCENTS:
            inside = self._group()
            return inside + _ACCENTS[name] if len(inside) == 1 else f"{name}({inside})"
        if name in _PLAIN:
            return self._group()
        if name in ("begin", "end"):
            self._group()
            return ""
        if name == "\\":
            return ";   "
        return str(_GREEK.get(name, _SIGNS.get(name, name)))


def _closed(text: str) -> str:
    """Return `text`, in parentheses where it is more than one thing."""
    return text if re.fullmatch(r"[\w.'̇̈]+|\(.*\)", text) else f"({text})"


def _raised(text: str, mark: str) -> str:
    """Return an index or a power: raised or lowered letters where there are such."""
    table = _UP if mark == "^" else _DOWN
    if text and all(letter in table for letter in text):
        return "".join(str(table[letter]) for letter in text)
    if text == "°" or text == "'":
        return text
    return mark + (text if len(text) == 1 or (mark == "_" and text.isalnum()) else f"({text})")
