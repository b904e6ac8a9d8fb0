"""Numbers and lists as words: units are in the columns' heads, and what is not known is a dash."""

import math
from collections.abc import Sequence

UNKNOWN = "–"


def number(value: float | None, digits: int = 1, factor: float = 1.0) -> str:
    """`value * factor` with so many decimals."""
    return UNKNOWN if value is None or not math.isfinite(value) else f"{value * factor:.{digits}f}"


def clock(seconds: float | None, digits: int = 0) -> str:
    """Minutes and seconds as mm:ss, or mm:ss.s with one digit."""
    if seconds is None or not math.isfinite(seconds):
        return UNKNOWN
    rounded = round(seconds, digits)
    minutes = int(rounded // 60)
    width = 3 + digits if digits else 2
    return f"{minutes:02d}:{rounded - 60 * minutes:0{width}.{digits}f}"


def percent(share: float | None, digits: int = 0) -> str:
    """A share with its sign."""
    text = number(share, digits, 100.0)
    return text if text == UNKNOWN else f"{text} %"


def listed(words: Sequence[str]) -> str:
    """a, b and c."""
    return " and ".join(([", ".join(words[:-1])] if len(words) > 1 else []) + list(words[-1:]))


def ranges(numbers: Sequence[int]) -> str:
    """1–4, 7: consecutive numbers drawn together."""
    groups: list[list[int]] = []
    for n in sorted(set(numbers)):
        if groups and n == groups[-1][-1] + 1:
            groups[-1].append(n)
        else:
            groups.append([n])
    return ", ".join(f"{g[0]}–{g[-1]}" if len(g) > 1 else str(g[0]) for g in groups)


def counted(n: int, singular: str) -> str:
    """1 run, 2 runs."""
    return f"{n} {singular if n == 1 else singular + 's'}"
