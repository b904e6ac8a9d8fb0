"""Movers as a user asks for them: by number, or in a file."""

from pathlib import Path

from simulated_movers.drawn import drawn_movers
from simulated_movers.specification import MoverSpec, read_movers


def asked_movers(text: str, seed: int) -> tuple[MoverSpec, ...]:
    """None for an empty text, so many from the seed for a number, else those of a YAML file. ValueError in one line for anything else."""
    if not text:
        return ()
    if text.isdecimal():
        return drawn_movers(int(text), seed)
    if not Path(text).is_file():
        raise ValueError(f"{text} is neither a number nor a file of movers")
    return read_movers(Path(text))
