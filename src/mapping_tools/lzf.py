"""LZF, the compression of PCD files (Marc Lehmann's liblzf), with every length checked before it is used."""

from __future__ import annotations

MOST_TIMES = 88  # three bytes stand for at most 264


def unpacked(data: bytes, size: int) -> bytes:
    """What `data` stands for, `size` bytes of it; ValueError when it stands for more or less, or points before its beginning."""
    if size > MOST_TIMES * len(data):
        raise ValueError(f"{len(data)} compressed bytes cannot stand for {size}")
    out, at, end = bytearray(), 0, len(data)
    try:
        while at < end and len(out) <= size:
            control = data[at]
            at += 1
            if control < 32:  # that many bytes, and one, as they are
                out += data[at : at + control + 1]
                at += control + 1
                continue
            length = control >> 5
            if length == 7:
                length += data[at]
                at += 1
            _repeat(out, ((control & 31) << 8) + data[at] + 1, length + 2)
            at += 1
    except IndexError:
        raise ValueError("its compressed data are cut off") from None
    if len(out) != size or at != end:
        raise ValueError(f"its compressed data stand for {len(out)} bytes, not {size}")
    return bytes(out)


def _repeat(out: bytearray, distance: int, length: int) -> None:
    """Appends `length` bytes from so far back; the last `distance` bytes over and over where it reaches into itself."""
    begin = len(out) - distance
    if begin < 0:
        raise ValueError("its compressed data point before their beginning")
    piece = out[begin : begin + length]
    out += (piece * (-(-length // len(piece))))[:length]
