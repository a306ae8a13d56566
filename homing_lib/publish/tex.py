"""Plain text, as docstrings and verdicts have it, in LaTeX."""

import re

_SYMBOLS = ["alpha", "beta", "gamma", "delta", "epsilon", "theta", "lambda", "pi", "sigma", "tau", "phi", "psi"]
_MATHS = re.compile(
    rf"(?P<code>`[^`]*`)|(?P<power>\b\d+(\.\d+)?e[+-]?\d+\b)|(?P<percent>[\d\]] ?%)"
    rf"|\b(?P<symbol>({'|'.join(_SYMBOLS)}|NRB|EP|ep|phi|r|Q|H)(?=\b|_))(?P<sub>_(\([^)]*\)|\w+))?(?P<up>\^\d)?(?!\w)"
)


def tex(text: str) -> str:
    """Plain text as LaTeX: its specials escaped, its symbols (alpha_0, sigma^2, 1.25e-3) in maths, `names` in code."""
    parts, end = [], 0
    for match in _MATHS.finditer(text):
        parts += [escaped(text[end : match.start()]), _as_maths(match)]
        end = match.end()
    return "".join([*parts, escaped(text[end:])])


def row(first: str, *cells: str) -> str:
    """A row of a table. first: LaTeX already; cells: plain text."""
    return " & ".join([first, *(tex(cell) for cell in cells)]) + r" \\"


def escaped(text: str) -> str:
    """Plain text as LaTeX, letter by letter: its specials, its signs that TeX has no letter for, and the minus."""
    return re.sub(r"(?<![\w.)])-(?=[\d.])|(?<= )-(?= )", "$-$", text.translate(_SPECIAL)).translate(_UNICODE)


def _as_maths(match: "re.Match[str]") -> str:
    if match["code"]:
        return f"\\texttt{{{escaped(match['code'][1:-1])}}}"
    if match["percent"]:
        return f"{match['percent'][0]}\\,\\%"
    if match["power"]:
        digits, exponent = match["power"].split("e")
        return f"${digits}\\times10^{{{int(exponent)}}}$"
    symbol, sub, up = match["symbol"], match["sub"], match["up"] or ""
    if not sub and not up and symbol not in _SYMBOLS:
        return escaped(symbol)
    name = f"\\{symbol}".replace("epsilon", "varepsilon") if symbol in _SYMBOLS else f"\\mathrm{{{symbol}}}"
    index = (sub or "")[1:].strip("()")
    if len(index) > 3 and "-" not in index:
        index = f"\\mathrm{{{index}}}"
    return f"${name}" + (f"_{{{index}}}" if index else "") + f"{up}$"


_SPECIAL = str.maketrans(
    {letter: f"\\{letter}" for letter in "{}$&#%_"}
    | {"\\": r"\textbackslash{}", "^": r"\textasciicircum{}", "~": r"\textasciitilde{}"}
)
_UNICODE = str.maketrans(
    {"≥": r"$\geq$", "≤": r"$\leq$", "±": r"$\pm$", "×": r"$\times$", "²": r"\textsuperscript{2}", "λ": r"$\lambda$"}
)
